"""Ctrl-C, SIGTERM, a killed launcher, two launchers: no orphan, nothing runs twice, the next command goes on."""

import os
import signal
import subprocess
import time

import pytest

from tests.experiment.command import Done, calls, manifest, run, run_path, said, start
from tests.gate import open_gate, waiting

GRID = ("-m", "protocol=smoke", "seed=range(3)", "hydra.launcher.n_jobs=2")


def wait_for(condition, seconds=120):
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(0.05)


def pids(results, seeds):
    return [int(calls(results, seed)[-1].split()[0]) for seed in seeds]


def hanging(results, *seeds):
    return lambda: all((run_path(results, seed) / "state" / "hanging").exists() for seed in seeds)


def alive(pid):
    """A process that is dead and not yet reaped is not alive."""
    state = subprocess.run(["ps", "-o", "stat=", "-p", str(pid)], capture_output=True, text=True).stdout.strip()
    return bool(state) and not state.startswith("Z")


@pytest.fixture
def gate(tmp_path):
    folder = tmp_path / "gate"
    folder.mkdir()
    return folder


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_one_signal_takes_a_checkpoint_and_the_same_command_goes_on(tmp_path, gate, number):
    sweep = start(tmp_path, *GRID, gate=str(gate))
    wait_for(lambda: len(waiting(gate, 0, 1)) == 2)
    jobs = pids(tmp_path, (0, 1))
    if number == signal.SIGINT:
        os.killpg(sweep.pid, number)  # as a terminal does
    else:
        sweep.send_signal(number)
    done = Done(sweep)
    assert done.code == 75, done
    assert not any(alive(pid) for pid in jobs)
    assert [manifest(tmp_path, seed)["status"] for seed in (0, 1)] == ["interrupted"] * 2
    assert not run_path(tmp_path, 2).exists()
    if number == signal.SIGTERM:
        return
    again = run(tmp_path, *GRID)
    assert again.code == 0, again
    assert "resume" in again.out
    assert not calls(tmp_path, 0)[-1].endswith("from 0")
    assert manifest(tmp_path, 0)["times_resumed"] == 1


def test_a_second_ctrl_c_kills_jobs_that_do_not_stop(tmp_path):
    sweep = start(tmp_path, *GRID, **{"0": "hang", "1": "hang"})
    wait_for(hanging(tmp_path, 0, 1))
    jobs = pids(tmp_path, (0, 1))
    sweep.send_signal(signal.SIGINT)
    assert said(sweep, "stopping: the running jobs take a checkpoint")
    assert all(alive(pid) for pid in jobs), "the first Ctrl-C gives them time"
    sweep.send_signal(signal.SIGINT)
    done = Done(sweep)
    assert done.code == 75 and "finished: 2 interrupted, 1 not started" in done.out, done
    assert not any(alive(pid) for pid in jobs)


def test_a_signal_while_jobs_start_is_no_failure(tmp_path):
    """They can't take it yet, and have no manifest to say how they ended."""
    sweep = start(tmp_path, *GRID, importing=60)
    wait_for(lambda: all((run_path(tmp_path, seed) / "state" / "log.txt").exists() for seed in (0, 1)))
    sweep.send_signal(signal.SIGINT)
    done = Done(sweep)
    assert done.code == 75 and "finished: 2 interrupted, 1 not started" in done.out, done
    assert run(tmp_path, *GRID).code == 0


@pytest.mark.parametrize("without", [[], ["prctl"]])
def test_a_killed_launcher_leaves_no_orphan(tmp_path, gate, without):
    """Linux tells the jobs by prctl; where there is none they look."""
    sweep = start(tmp_path, *GRID, gate=str(gate), without=without)
    wait_for(lambda: len(waiting(gate, 0, 1)) == 2)
    jobs = pids(tmp_path, (0, 1))
    sweep.kill()
    sweep.communicate()
    wait_for(lambda: not any(alive(pid) for pid in jobs))
    log = (run_path(tmp_path) / "state" / "log.txt").read_text()
    files = sorted(path.name for path in (run_path(tmp_path) / "state").iterdir())
    assert manifest(tmp_path, 0)["status"] == "interrupted", (log, files, calls(tmp_path, 0))


def test_a_second_sigterm_while_the_first_is_being_obeyed_loses_no_record(tmp_path, gate):
    """Whoever asks twice, as a cluster or an impatient person does, must not leave a manifest that says `running`."""
    sweep = start(tmp_path, *GRID, gate=str(gate), recording=2)
    wait_for(lambda: len(waiting(gate, 0, 1)) == 2)
    jobs = pids(tmp_path, (0, 1))
    sweep.kill()
    sweep.communicate()
    wait_for(lambda: all((run_path(tmp_path, seed) / "state" / "recording").exists() for seed in (0, 1)))
    for pid in jobs:
        os.kill(pid, signal.SIGTERM)
    wait_for(lambda: not any(alive(pid) for pid in jobs))
    assert [manifest(tmp_path, seed)["status"] for seed in (0, 1)] == ["interrupted"] * 2


def test_two_launchers_at_once_run_no_cell_twice(tmp_path, gate):
    """Whichever launcher comes first to a cell, the other finds it busy and goes on to the next."""
    grid = ("-m", "protocol=smoke", "seed=range(4)", "hydra.launcher.n_jobs=2")
    both = [start(tmp_path, *grid, gate=str(gate)) for _ in range(2)]
    wait_for(lambda: len(waiting(gate, *range(4))) == 4)
    open_gate(gate, *range(4))
    done = [Done(each) for each in both]
    assert all(each.code in (0, 75) for each in done), done
    for seed in range(4):
        assert len(calls(tmp_path, seed)) == 1, "trained twice"
        assert manifest(tmp_path, seed)["status"] == "complete"


def test_a_single_run_is_interrupted_resumes_and_is_skipped(tmp_path, gate):
    single = start(tmp_path, "protocol=smoke", gate=str(gate))
    wait_for(lambda: waiting(gate, 0))
    os.kill(single.pid, signal.SIGINT)
    done = Done(single)
    assert done.code == 75 and "the same command again" in done.out, done
    assert manifest(tmp_path)["status"] == "interrupted"
    again = run(tmp_path, "protocol=smoke")
    assert again.code == 0 and "resume" in again.out, again
    third = run(tmp_path, "protocol=smoke")
    assert third.code == 0 and "0 to do, 1 done" in third.out and len(calls(tmp_path)) == 2, third
    longer = run(tmp_path, "protocol=smoke", "protocol.total_steps=3000")
    assert longer.code == 2 and "keep_replay=true" in longer.err and manifest(tmp_path)["step"] == 2000, longer


def test_a_single_run_in_a_scripts_background_takes_a_checkpoint(tmp_path, gate):
    """There a shell has SIGINT ignored."""
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        single = start(tmp_path, "protocol=smoke", gate=str(gate))
    finally:
        signal.signal(signal.SIGINT, before)
    wait_for(lambda: waiting(gate, 0))
    os.kill(single.pid, signal.SIGINT)
    done = Done(single)
    assert done.code == 75 and manifest(tmp_path)["status"] == "interrupted", done


def test_a_complete_run_whose_replay_was_kept_is_extended(tmp_path):
    assert run(tmp_path, "protocol=smoke", "keep_replay=true").code == 0
    longer = run(tmp_path, "protocol=smoke", "protocol.total_steps=3000")
    assert longer.code == 0 and manifest(tmp_path)["step"] == 3000, longer


def test_a_second_ctrl_c_ends_a_single_run_at_once(tmp_path):
    single = start(tmp_path, "protocol=smoke", **{"0": "hang"})
    wait_for(hanging(tmp_path, 0))
    os.kill(single.pid, signal.SIGINT)
    wait_for((run_path(tmp_path) / "state" / "asked to stop").exists)
    os.kill(single.pid, signal.SIGINT)
    done = Done(single)
    assert done.code == 130, done
    assert manifest(tmp_path)["status"] == "interrupted"


def test_a_failing_single_run_is_one_line_and_exit_1(tmp_path):
    done = run(tmp_path, "protocol=smoke", **{"0": "raise"})
    assert done.code == 1, done
    assert "RuntimeError: boom" in done.err and "failure.txt" in done.err and "Traceback" not in done.err, done


@pytest.mark.parametrize("launcher", ["basic"])
def test_hydras_own_launcher_keeps_the_rules(tmp_path, launcher):
    grid = ("-m", f"hydra/launcher={launcher}", "protocol=smoke", "seed=range(3)")
    done = run(tmp_path, *grid, **{"1": "raise"})
    assert done.code == 1 and "1 failed" in done.out, done
    assert [manifest(tmp_path, seed)["status"] for seed in range(3)] == ["complete", "failed", "complete"]
    again = run(tmp_path, *grid)
    assert again.code == 0 and "1 to do, 2 done" in again.out, again
    assert len(calls(tmp_path, 0)) == 1
