"""If these fail, a person believes that a grid is further than it is."""

import json

import pytest

from src import status
from src.experiment.ownership import acquire
from src.experiment.run_directory import Failure
from tests.experiment.runs import smoke


@pytest.fixture
def study(tmp_path):
    def left(*overrides, status, step, failure=None):
        with acquire(smoke(tmp_path, *overrides)) as (run, _):
            run.evaluations.append(0, [(1.0, 5)])
            run.evaluations.append(step, [(10.0, 5), (20.0, 5)])
            run.training.write({"step": step, "steps_per_second": 50.0})
            run.update_manifest(status=status, step=step, failure=failure)

    left("seed=0", status="complete", step=2000)
    left("seed=1", status="running", step=1000)  # its process is gone
    left("seed=3", status="failed", step=500, failure=Failure("OSError", "the disk is full", 500))
    left("actor=aan", "seed=0", status="diverged", step=700, failure=Failure("diverged", "nan at step 700", 700))
    return tmp_path / "smoke"


def test_the_table_shows_every_seed_under_its_state(study, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "200")
    assert status.main([str(study)]) == 1
    out = capsys.readouterr().out
    rows = {line.split()[2]: line.split() for line in out.splitlines() if line.startswith("td3")}
    # algo env label encoder | done interrupted failed (diverged: none) | return, steps, steps/s, time left
    assert rows["bptsan"][4:] == ["0", "1", "3", "15.0", "15.0", "500/2k", "50", "-"]
    assert rows["aan"][4:] == ["0", "1,3", "15.0", "-", "700/2k", "50", "-"]
    assert "runs: 1 done, 1 interrupted, 1 failed, 1 diverged, 2 missing" in out
    assert "failed: td3/hopper/bptsan/poisson/seed_3: the disk is full" in out
    assert "diverged: td3/hopper/aan/none/seed_0: nan at step 700" in out


def test_what_a_return_is_the_mean_of_is_said_and_the_last_tenth_is_of_complete_runs(study, tmp_path, capsys):
    """A last evaluation flatters or slanders a run; the report's number is the mean of the last 10 %."""
    with acquire(smoke(tmp_path, "seed=5")) as (run, _):
        for step, value in ((0, 1.0), (1800, 100.0), (1900, 10.0), (2000, 30.0)):
            run.evaluations.append(step, [(value, 5), (value, 5)])
        run.update_manifest(status="complete", step=2000)
    five = status.read_study(study)[1].runs[-1]
    assert (five.last_return, five.final_return) == (30.0, 20.0)  # beyond 0.9 * 2,000
    assert status.read_study(study)[1].runs[1].final_return is None
    status.main([str(study)])
    assert "newest evaluation" in capsys.readouterr().out


def test_a_live_run_is_running_and_its_time_left_is_told(study, tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "200")
    with acquire(smoke(tmp_path, "seed=1")):
        status.main([str(study)])
    assert "20 s" in capsys.readouterr().out  # 1,000 steps at 50 a second


def test_a_complete_run_is_as_fast_as_it_was_over_all(study, tmp_path):
    with acquire(smoke(tmp_path, "seed=4")) as (run, _):
        run.training.write({"step": 2000, "steps_per_second": 50.0})
        run.update_manifest(status="complete", step=2000, wall_time_seconds=16.0)
    assert {one.seed: one.steps_per_second for one in status.read_study(study)[1].runs} == {
        0: 50.0,
        1: 50.0,
        3: 50.0,
        4: 125.0,
    }


def test_json(study, capsys):
    assert status.main([str(study), "--json"]) == 1
    rows = {row["label"]: row for row in json.loads(capsys.readouterr().out)}
    assert [run["state"] for run in rows["bptsan"]["runs"]] == ["complete", "interrupted", "failed"]
    assert rows["aan"]["missing"] == [1, 3] and rows["bptsan"]["missing"] == []
    assert rows["bptsan"]["runs"][0]["last_return"] == 15.0


@pytest.mark.parametrize(
    ("left", "code"), [({"status": "complete"}, 0), ({"status": "diverged"}, 0), ({"status": "interrupted"}, 75)]
)
def test_exit_codes(tmp_path, left, code):
    with acquire(smoke(tmp_path)) as (run, _):
        run.update_manifest(step=2000, **left)
    assert status.main([str(tmp_path / "smoke")]) == code


def test_no_such_study_is_one_sentence(tmp_path, capsys):
    assert status.main([str(tmp_path / "nope")]) == 2
    assert "there is no such study" in capsys.readouterr().err
    (tmp_path / "empty").mkdir()
    assert status.main([str(tmp_path / "empty")]) == 2
    assert "no runs in it yet" in capsys.readouterr().err


def test_seeds_are_told_as_ranges():
    assert status.ranges([0, 1, 2, 3, 7, 9, 10]) == "0-3,7,9-10" and status.ranges([]) == ""
