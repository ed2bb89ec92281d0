"""If these fail, a mistyped path writes folders where they don't belong, or hours later than it could be told."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from analysis.__main__ import main
from benchmarks.synthetic import write_run

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def results(tmp_path):
    write_run(tmp_path / "results/a")
    write_run(tmp_path / "results/b")
    return tmp_path / "results"


def everything(folder):
    return sorted(str(path) for path in folder.rglob("*"))


@pytest.mark.parametrize("stage", ["report", "collect", "figures", "statistics", "render"])
@pytest.mark.parametrize(
    ("below", "says"),
    [
        ("", "it holds the folders of studies (a, b): name one, such as"),
        ("a/runs", "it lies in the study a: name that folder."),
        ("a/runs/td3/hopper/bptsan/poisson/seed_0", "it lies in the study a: name that folder."),
        ("a/runs/td3/hopper/bptsan/poisson/seed_0/config.yaml", "it lies in the study a: name that folder."),
        ("c", "There is no folder"),
    ],
)
def test_what_is_no_study_is_refused_and_nothing_is_written(results, capsys, stage, below, says):
    before = everything(results)
    assert main([stage, str(results / below)]) == 2
    assert says in capsys.readouterr().err and everything(results) == before


def test_a_folder_without_runs_is_no_study(tmp_path, capsys):
    (tmp_path / "s").mkdir()
    assert main(["report", str(tmp_path / "s")]) == 2
    assert "holds its run directories in runs/" in capsys.readouterr().err and not any((tmp_path / "s").iterdir())


def test_a_wrong_claims_file_is_told_before_anything_is_written(results, capsys):
    before = everything(results)
    assert main(["report", str(results / "a"), "--claims", str(results / "none.yaml")]) == 2
    assert "none.yaml" in capsys.readouterr().err and everything(results) == before


def test_the_home_folder_may_be_written_as_a_tilde(results, monkeypatch, capsys):
    monkeypatch.setenv("HOME", str(results.parent))
    assert main(["collect", "~/results/a"]) == 0
    assert (results / "a/collected/study.json").is_file()
    assert main(["compare", "~/results/a", "~/results/b"]) == 0
    assert main(["compare", "bptsan", "bptsan", "--study", "~/results/a"]) == 0


def test_relative_paths_start_where_the_command_is_typed(results):
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-m", "analysis", "collect", "a"]
    done = subprocess.run(command, cwd=results, env=environment, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    assert (results / "a/collected/study.json").is_file()


def test_what_cannot_be_written_is_a_sentence(results, capsys):
    (results / "a/.collected.new").write_text("a file where the new folder is made")
    assert main(["collect", str(results / "a")]) == 2
    assert "error: " in capsys.readouterr().err


@pytest.mark.parametrize(
    ("name", "text"),
    [("study.json", "{"), ("study.json", "[]"), ("study.json", '{"format": 1}'), ("runs.csv", ""), ("runs.csv", None)],
)
def test_damaged_collected_files_are_a_sentence_that_says_how_to_mend_them(results, capsys, name, text):
    assert main(["collect", str(results / "a")]) == 0
    path = results / "a/collected" / name
    path.unlink()
    if text is None:
        path.mkdir()
    else:
        path.write_text(text)
    assert main(["statistics", str(results / "a")]) == 2
    assert f"run `python -m analysis collect {results / 'a'}` again" in capsys.readouterr().err
