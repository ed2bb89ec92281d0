"""One job's end, whatever it is, takes no other job with it, and manifest, table and exit code agree."""

import re
from types import SimpleNamespace
from unittest.mock import Mock

import pytest

from src.experiment.launch.local import LocalSettings, Pool
from tests.experiment.command import calls, manifest, run, run_path


@pytest.fixture(scope="module")
def sweep(tmp_path_factory):
    """A grid in which nearly everything goes wrong, a job that hangs, and all of it again when nothing does.

    The one that hangs is alone: how long a job may be silent is not for the others, however slow the machine is.
    """
    results = tmp_path_factory.mktemp("results")
    grid = ("-m", "protocol=smoke", "hydra.launcher.n_jobs=4")
    wrong = {"1": "raise", "2": "exit", "3": "kill", "4": "diverge", "5": "enospc", "6": "hang in native code"}
    first = run(results, *grid, "seed=range(6)", **wrong)
    hung = run(results, *grid, "seed=6", "hydra.launcher.hang_minutes=0.1", **wrong)
    before = {seed: manifest(results, seed) for seed in range(7)}
    files = {seed: (run_path(results, seed) / "failure.txt").exists() for seed in range(7)}
    return results, (first, hung), before, files, run(results, *grid, "seed=range(7)")


def test_the_others_go_on(sweep):
    _, (first, hung), before, _, _ = sweep
    assert before[0]["status"] == "complete"
    assert first.code == hung.code == 1, (first, hung)


@pytest.mark.parametrize(
    ("seed", "status", "kind", "message"),
    [
        (1, "failed", "RuntimeError", "boom"),
        (2, "failed", "SystemExit", r"sys\.exit\(3\)"),
        (3, "failed", "killed by SIGKILL", "out of memory"),
        (4, "diverged", "diverged", "not finite at step 500"),
        (5, "failed", "OSError", "the disk is full"),
        (6, "failed", "hung", "no sign of life"),
    ],
)
def test_each_end_is_recorded_and_told(sweep, seed, status, kind, message):
    _, (first, hung), before, _, _ = sweep
    first = hung if seed == 6 else first
    assert before[seed]["status"] == status
    assert before[seed]["failure"]["kind"].startswith(kind)
    assert re.search(message, before[seed]["failure"]["message"])
    table = first.out[first.out.index("finished:") :]
    assert re.search(rf"^{status} +td3/hopper/bptsan/poisson/seed_{seed}  .*{message}", table, re.MULTILINE), first


def test_the_traceback_is_where_the_table_says(sweep):
    results, (first, _), _, files, _ = sweep
    assert files == {0: False, 1: True, 2: True, 3: False, 4: False, 5: True, 6: False}
    assert str(run_path(results, 1) / "failure.txt") in first.out
    assert 'raise RuntimeError("boom' in (run_path(results, 1) / "state" / "log.txt").read_text()


def test_earlier_evaluations_are_intact(sweep):
    results, *_ = sweep
    for seed in (0, 1, 2, 3, 5, 6):
        steps = [line.split(",")[0] for line in (run_path(results, seed) / "evaluations.csv").read_text().splitlines()]
        assert steps[:2] == ["step", "0"]
        assert steps[2:] == [str(500 * k) for k in (1, 2, 3, 4) for _ in range(2)]


def test_the_same_command_again_finishes_the_grid(sweep):
    results, _, _, _, again = sweep
    assert again.code == 0, again
    assert "5 to do, 2 done" in again.out
    for seed in (0, 1, 2, 3, 5, 6):
        assert manifest(results, seed)["status"] == "complete"
        assert not (run_path(results, seed) / "failure.txt").exists()
    assert manifest(results, 4)["status"] == "diverged"
    assert len(calls(results, 0)) == 1 and len(calls(results, 4)) == 1
    assert manifest(results, 1)["times_resumed"] == 1


def test_progress_is_one_line_per_cell(sweep):
    _, _, _, _, again = sweep
    assert re.search(
        r"^\[\d/5\] td3/hopper/bptsan/poisson/seed_1 complete \d+ s return 333\.8$", again.out, re.MULTILINE
    )


def test_a_grid_without_torch_and_with_another_working_directory(tmp_path):
    """The stub forbids torch; a relative results_dir lies in the repository, so an absolute one is used here."""
    from tests.experiment.command import ROOT, Done, start

    done = Done(start(tmp_path / "r", "sweeps=demo", "env=hopper", "seed=0", "actor=aan", cwd=ROOT.parent))
    assert done.code == 0, done
    assert manifest(tmp_path / "r", 0, study="demo", label="aan", encoder="none")["status"] == "complete"


def test_a_kill_before_the_run_has_begun_is_recorded_too(tmp_path, monkeypatch):
    """An import that is killed leaves no manifest: the launcher writes it."""
    from src.experiment.ownership import record_death
    from tests.experiment.runs import smoke

    run = smoke(tmp_path)
    (run.path / "state").mkdir(parents=True)
    record_death(run, "killed by SIGKILL (out of memory?)")
    assert manifest(tmp_path)["status"] == "failed"


def test_threads_are_set_in_the_environment_of_the_job():
    from src.experiment.process import thread_environment

    assert thread_environment(3)["OMP_NUM_THREADS"] == "3"


def test_a_job_killed_as_hung_stays_hung_when_a_last_sign_arrives():
    job = SimpleNamespace(hung=False, process=Mock(), silent_seconds=Mock(side_effect=[999.0, 0.0]))
    pool = Pool(LocalSettings(n_jobs=1, grace_seconds=1.0, hang_minutes=1.0), 1, Mock())
    pool._jobs = [job]
    pool._watch()
    pool._watch()
    assert job.process.kill.call_count == 2
    assert "hung" in pool._cause_of_death(job, -9)
