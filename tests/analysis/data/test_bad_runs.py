"""If these fail, a run that somebody else wrote gives a wrong number in silence, or takes the whole report with it."""

import itertools
import json
import os
import shutil
import subprocess
import sys

import numpy as np
import pytest

from analysis.__main__ import main
from analysis.data.cells import cells_of
from analysis.data.collected import collect, load
from analysis.data.study import read_study
from benchmarks.synthetic import write_run

LETTERS = "abcdefghi"
BOMB = "a: &a [x,x,x,x,x,x,x,x,x]\n" + "".join(
    f"{name}: &{name} [{','.join([f'*{before}'] * 9)}]\n" for before, name in itertools.pairwise(LETTERS)
)
MERGE_BOMB = "a: &a {x: 1}\n" + "".join(
    f"{name}: &{name}\n  <<: [{','.join([f'*{before}'] * 9)}]\n" for before, name in itertools.pairwise(LETTERS)
)


def rows(change):
    """Change the text of evaluations.csv."""

    def apply(run):
        text = (run / "evaluations.csv").read_text()
        assert change(text) != text
        (run / "evaluations.csv").write_text(change(text))

    return apply


def config(old, new):
    """Exchange a piece of config.yaml."""

    def apply(run):
        text = (run / "config.yaml").read_text()
        assert old in text
        (run / "config.yaml").write_text(text.replace(old, new, 1))

    return apply


def manifest(**keys):
    """Exchange keys of manifest.json."""

    def apply(run):
        content = json.loads((run / "manifest.json").read_text())
        (run / "manifest.json").write_text(json.dumps(content | keys))

    return apply


def without(key):
    """Take a key of manifest.json away."""

    def apply(run):
        content = json.loads((run / "manifest.json").read_text())
        del content[key]
        (run / "manifest.json").write_text(json.dumps(content))

    return apply


def folder(name):
    """Put a folder where a file should be."""

    def apply(run):
        (run / name).unlink()
        (run / name).mkdir()

    return apply


def pipe(run):
    (run / "manifest.json").unlink()
    os.mkfifo(run / "manifest.json")


def huge_seed(run):
    manifest(seed=10**30)(run)
    run.rename(run.with_name(f"seed_{10**30}"))


#: name: the damage, and what the note has to say.
LEFT_OUT = {
    "more episodes than configured": (rows(lambda t: t + "50000,2,7.0,200\n"), "episode 2 at step 50,000"),
    "a negative episode": (rows(lambda t: t.replace("50000,0,", "50000,-1,")), "episode -1 at step 50,000"),
    "a negative step": (rows(lambda t: t + "-50000,0,7.0,200\n-50000,1,7.0,200\n"), "step -50,000"),
    "a step past the end": (rows(lambda t: t + "110000,0,7.0,200\n110000,1,7.0,200\n"), "step 110,000"),
    "a length of nothing": (rows(lambda t: t.replace(",200\n", ",0\n", 1)), "length 0"),
    "a return of 1e300": (rows(lambda t: t.replace("50000,1,499.0", "50000,1,1e300")), "return 1e+300 at step 50,000"),
    "a step beyond int64": (rows(lambda t: t.replace("50000,1,", f"{10**20},1,")), "no whole number in column step"),
    "half a step": (rows(lambda t: t.replace("50000,1,", "50000.5,1,")), "no whole number in column step"),
    "a quoted number": (rows(lambda t: t.replace("50000,1,", '"50000",1,')), "no whole number in column step"),
    "a hole in the file": (rows(lambda t: t.replace("50000,1,", "5\0\0\0\0,1,")), "zero bytes"),
    "a folder for evaluations": (folder("evaluations.csv"), "its evaluations.csv is not a file"),
    "a folder for the manifest": (folder("manifest.json"), "its manifest.json is not a file"),
    "a folder for the configuration": (folder("config.yaml"), "its config.yaml is not a file"),
    "a pipe": (pipe, "its manifest.json is not a file"),
    "an interval in words": (
        config("evaluation_interval: 10000", "evaluation_interval: often"),
        "protocol.evaluation_interval = 'often' (should be a valid integer)",
    ),
    "no interval": (config("  evaluation_interval: 10000\n", ""), "config.yaml lacks protocol.evaluation_interval"),
    "an interval of 0": (config("evaluation_interval: 10000", "evaluation_interval: 0"), "evaluation_interval = 0"),
    "a configuration that is a list": (lambda run: (run / "config.yaml").write_text("[1]"), "not a table of keys"),
    "an alias bomb": (lambda run: (run / "config.yaml").write_text(BOMB), "more than 20,000 values"),
    "an alias bomb of merged keys": (lambda run: (run / "config.yaml").write_text(MERGE_BOMB), "more than 20,000"),
    "an alias of itself": (lambda run: (run / "config.yaml").write_text("a: &a [*a]"), "config.yaml cannot be read"),
    "a well without bottom": (lambda run: (run / "config.yaml").write_text("[" * 9999), "nested more than 40 deep"),
    "a date that is none": (config("sweeps: null", "sweeps: 2020-13-45"), "config.yaml cannot be read"),
    "a status in a list": (manifest(status=["complete"]), "status = ['complete'] (should be 'running', 'complete'"),
    "a step in words": (manifest(step="abc"), "step = 'abc' (should be a valid integer)"),
    "no label": (without("label"), "manifest.json lacks label"),
    "no length": (without("total_steps"), "manifest.json lacks total_steps"),
    "a seed of 31 digits": (huge_seed, "seed = 1000000000000000000000000000000 (should be less"),
    "more evaluations than memory": (manifest(total_steps=2**62), "total_steps = 4611686018427387904"),
    "too many evaluations": (
        lambda run: (
            manifest(total_steps=10**12)(run),
            config("evaluation_interval: 10000", "evaluation_interval: 1")(run),
        ),
        "1,000,000,000,000 steps and an evaluation every 1",
    ),
    "versions in a list": (manifest(versions=["1"]), "versions = ['1']"),
    "half a letter": (lambda run: rewrite_label(run, "\\ud800"), "it is no JSON"),
}


def rewrite_label(run, label):
    text = (run / "manifest.json").read_text()
    (run / "manifest.json").write_text(text.replace('"commit": "', f'"commit": "{label}'))


@pytest.mark.parametrize("name", LEFT_OUT)
def test_a_bad_run_costs_itself_and_says_why(tmp_path, name):
    damage, reason = LEFT_OUT[name]
    write_run(tmp_path / "s", seed=1)
    damage(write_run(tmp_path / "s", curve=np.full(11, 500.0)))
    collect(tmp_path / "s")
    study = load(tmp_path / "s")
    assert study.runs["seed"].tolist() == [1] and set(study.evaluations["seed"]) == {1}
    (note,) = study.warnings
    assert reason in note and note.endswith("; it was left out.") and "\n" not in note


def test_a_report_over_all_of_them_at_once_shows_the_good_runs(tmp_path):
    for seed in range(1000, 1003):
        write_run(tmp_path / "s", seed=seed, noise=10)
        write_run(tmp_path / "s", actor="popsan", seed=seed, noise=10)
    for seed, (damage, _) in enumerate(LEFT_OUT.values()):
        damage(write_run(tmp_path / "s", seed=seed, curve=np.full(11, 500.0)))
    for seed, label in enumerate(("x" * 200, "a\nb", "<b>$x_1$ % & \\ {")):
        write_run(tmp_path / "s", seed=seed, label=label)
    assert main(["report", str(tmp_path / "s")]) == 0
    study = load(tmp_path / "s")
    assert study.runs.groupby("arm").size().to_dict() == {
        "bptsan": 3, "popsan": 3, "x" * 200: 1, "a\nb": 1, "<b>$x_1$ % & \\ {": 1
    }  # fmt: skip
    page = (tmp_path / "s/report/index.html").read_text()
    assert page.count("it was left out.") == len(LEFT_OUT) and "it is no JSON" in page


def test_a_bomb_does_not_fill_the_memory(tmp_path):
    """In a process that may have 1 GB more than it needs for a sound study; written out, the bombs have 9 to the 9."""
    for seed, bomb in enumerate((BOMB, MERGE_BOMB)):
        (write_run(tmp_path / "s", seed=seed) / "config.yaml").write_text(bomb)
    code = f"""
import resource, sys
from pathlib import Path
from analysis.data.study import read_study
pages = int(Path("/proc/self/statm").read_text().split()[0]) if sys.platform == "linux" else 0
limit = pages * resource.getpagesize() + 2**30
if pages:
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
print(len(read_study(Path({str(tmp_path / "s")!r})).warnings))
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120)
    assert done.stdout.split() == ["3"], done.stdout + done.stderr  # two bombs, and that there are no runs


def test_a_folder_for_the_training_log_costs_the_training_log(tmp_path):
    folder("training.csv")(write_run(tmp_path / "s"))
    study = read_study(tmp_path / "s")
    assert study.runs["counts_as"].tolist() == ["finished"] and study.training.empty
    assert "its training.csv is not a file; its training data were left out" in study.warnings[0]


def test_a_byte_order_mark_and_the_line_ends_of_windows_change_nothing(tmp_path):
    run = write_run(tmp_path / "s")
    plain = read_study(tmp_path / "s")
    for name in ("manifest.json", "config.yaml", "evaluations.csv", "training.csv"):
        text = (run / name).read_text().replace("\n", "\r\n")
        (run / name).write_bytes(b"\xef\xbb\xbf" + text.encode())
    marked = read_study(tmp_path / "s")
    assert marked.warnings == plain.warnings == []
    assert marked.evaluations.equals(plain.evaluations) and marked.training.equals(plain.training)
    assert marked.configurations == plain.configurations


def test_a_non_finite_value_in_mid_curve_is_left_out_and_nothing_is_carried(tmp_path):
    run = write_run(tmp_path / "s", curve=np.arange(11.0))
    rows(lambda text: text.replace("50000,1,4.0", "50000,1,nan"))(run)
    study = read_study(tmp_path / "s")
    assert study.runs["counts_as"].tolist() == ["finished"] and not study.evaluations["carried"].any()
    assert study.evaluations["return"].tolist() == [0, 1, 2, 3, 4, 6, 7, 8, 9, 10]
    (note,) = study.warnings
    assert "left out (step 50,000)" in note and "nothing is carried forward" in note


def test_non_finite_values_up_to_the_end_are_divergence_from_the_last_finite_one(tmp_path):
    run = write_run(tmp_path / "s", curve=np.arange(11.0))
    rows(lambda text: text.replace("90000,1,8.0", "90000,1,inf").replace("100000,0,11.0", "100000,0,-inf"))(run)
    (cell,) = cells_of(read_study(tmp_path / "s"))
    assert cell.diverged.tolist() == [True] and cell.final.tolist() == [8.0]


def test_files_of_a_run_that_hold_no_returns_change_none(tmp_path):
    run = write_run(tmp_path / "s")
    before = read_study(tmp_path / "s")
    (run / "notes.csv").write_text("step,return\n1")
    for name in ("policy.pt", "policy_best.pt"):
        (run / name).write_bytes(b"\0")
    (run / "rasters/seed_3").mkdir(parents=True)
    (run / "rasters/step_100.npz").write_bytes(b"\0")
    (run / "state").mkdir()
    after = read_study(tmp_path / "s")
    assert after.warnings == before.warnings == []
    assert after.runs.equals(before.runs) and after.evaluations.equals(before.evaluations)


@pytest.mark.parametrize("damage", ["a word", "a folder", "a number beyond all machines"])
def test_damaged_operations_cost_the_operations(tmp_path, damage):
    run = write_run(tmp_path / "s")
    if damage == "a folder":
        (run / "operations.json").mkdir()
    else:
        text = "{" if damage == "a word" else json.dumps({"decisions": 10**30})
        (run / "operations.json").write_text(text)
    study = read_study(tmp_path / "s")
    (note,) = study.warnings
    assert "its operations were left out" in note and study.runs["counts_as"].tolist() == ["finished"]


def test_a_link_inside_the_study_is_no_second_arm_and_is_said(tmp_path):
    write_run(tmp_path / "s")
    (tmp_path / "s/runs/td3/hopper/mine").symlink_to("bptsan")
    (tmp_path / "s/runs/td3/hopper/gone").symlink_to("nowhere")
    study = read_study(tmp_path / "s")
    assert study.runs["arm"].tolist() == ["bptsan"]
    assert study.warnings == [
        "runs/td3/hopper/gone: it is a link that leads nowhere; it was left out.",
        "runs/td3/hopper/mine: it is a link to a folder of the same study; it was left out.",
    ]


def test_a_link_to_runs_elsewhere_is_read_and_said(tmp_path):
    write_run(tmp_path / "s")
    write_run(tmp_path / "large", env="ant")
    (tmp_path / "s/runs/td3/ant").symlink_to(tmp_path / "large/runs/td3/ant")
    study = read_study(tmp_path / "s")
    assert study.runs["env"].tolist() == ["ant", "hopper"]
    assert study.warnings == ["runs/td3/ant: it is a link; git does not carry what it leads to."]


def test_a_run_inside_a_run_is_said(tmp_path):
    run = write_run(tmp_path / "s")
    shutil.copytree(write_run(tmp_path / "t", seed=1), run / "seed_1")
    study = read_study(tmp_path / "s")
    assert study.runs["seed"].tolist() == [0]
    assert "seed_0/seed_1: its path is not" in study.warnings[0]


def test_the_configuration_of_another_run_is_noted(tmp_path):
    run = write_run(tmp_path / "s", noise=1)
    shutil.copy(write_run(tmp_path / "s", seed=1, noise=1) / "config.yaml", run / "config.yaml")
    (note,) = read_study(tmp_path / "s").warnings
    assert "its config.yaml has seed = 1, its manifest.json says 0" in note


def test_an_evaluation_that_is_missing_or_not_due_is_noted(tmp_path):
    rows(lambda text: text.replace("50000,", "52000,"))(write_run(tmp_path / "s"))
    assert [note.partition(": ")[2] for note in read_study(tmp_path / "s").warnings] == [
        "1 of its 11 evaluations are missing (step 50,000).",
        "it was evaluated at 1 steps at which none is due (step 52,000).",
    ]


def test_a_manifest_that_contradicts_itself_is_noted(tmp_path):
    write_run(tmp_path / "s", manifest={"step": 5})
    (note,) = read_study(tmp_path / "s").warnings
    assert "says complete at step 5 of 100,000" in note


def test_what_a_manifest_says_cannot_break_lines_or_steer_a_terminal(tmp_path):
    failure = {"kind": "E", "message": "a\nb\x1b[31m", "step": 1}
    write_run(tmp_path / "s", manifest={"notes": ["two\nlines\x1b[31m", "y" * 10**5], "failure": failure})
    study = read_study(tmp_path / "s")
    assert all(note.isprintable() and len(note) < 2_100 for note in study.warnings)
    assert study.runs["failure"].tolist() == ["E: a b [31m"]
