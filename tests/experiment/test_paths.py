"""If these fail, one command looks for a path where another has not put it, or finds out after hours of work."""

import pytest

from src import evaluate, status
from src.experiment.ownership import acquire
from src.paths import ROOT, repository_path
from tests.experiment.command import run
from tests.experiment.runs import smoke


def test_one_rule_for_paths(monkeypatch, tmp_path):
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.chdir(tmp_path)
    assert repository_path("results/paper") == ROOT / "results" / "paper"
    assert repository_path("~/results") == tmp_path / "results"
    assert repository_path(tmp_path / "x") == tmp_path / "x"


def test_a_home_in_results_dir(monkeypatch, tmp_path):
    monkeypatch.setenv("HOME", str(tmp_path / "a home"))
    done = run("~/runs", "protocol=smoke", "dry_run=true")
    assert done.code == 0 and str(tmp_path / "a home" / "runs" / "smoke") in done.out, done


def test_status_takes_a_home(monkeypatch, tmp_path, capsys):
    monkeypatch.setenv("HOME", str(tmp_path))
    with acquire(smoke(tmp_path)) as (directory, _):
        directory.update_manifest(status="complete", step=2000)
    assert status.main(["~/smoke"]) == 0, capsys.readouterr().err


@pytest.mark.parametrize("command", [status, evaluate])
def test_relative_paths_lie_in_the_repository(monkeypatch, tmp_path, capsys, command):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "results" / "nope").mkdir(parents=True)
    assert command.main(["results/nope"]) == 2
    assert str(ROOT / "results" / "nope") in capsys.readouterr().err


@pytest.mark.parametrize("csv", ["nope/episodes.csv", "", "file/episodes.csv"])
def test_the_place_of_the_table_is_looked_at_before_episodes_are_played(monkeypatch, tmp_path, capsys, csv):
    played = []
    monkeypatch.setattr(evaluate, "play", lambda *arguments: played.append(arguments))
    (tmp_path / "policy.pt").touch()
    (tmp_path / "file").touch()
    before = sorted(tmp_path.rglob("*"))
    assert evaluate.main([str(tmp_path), "--csv", str(tmp_path / csv)]) == 2
    assert not played and "--csv: " in capsys.readouterr().err
    assert sorted(tmp_path.rglob("*")) == before
