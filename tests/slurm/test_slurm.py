"""The parts of the Slurm launcher that need no Slurm."""

import os
import signal
import stat

import pytest

from src.experiment.launch.slurm import shares
from src.experiment.launch.slurm_job import Preemption
from src.experiment.launch.slurm_queue import GONE, JobState, QueueError, array_limit, job_states, result_in_slurm
from src.experiment.ownership import acquire
from src.experiment.run_directory import RunDirectory
from src.experiment.state import exit_code
from tests.experiment.command import run
from tests.experiment.runs import smoke
from tests.slurm.cluster import wait_for


@pytest.fixture
def program(tmp_path, monkeypatch):
    """A program on PATH that answers what it is told to."""
    monkeypatch.setenv("PATH", str(tmp_path))

    def answers(name, text, code=0):
        path = tmp_path / name
        path.write_text(f"#!/bin/sh\nwhile read -r line; do echo \"$line\"; done <<'END'\n{text}\nEND\nexit {code}\n")
        path.chmod(path.stat().st_mode | stat.S_IXUSR)

    return answers


def test_the_queue_is_read(program):
    program("squeue", "12_0|RUNNING|None|paper\n12_1|PENDING|BeginTime|a|b\n9|OUT_OF_MEMORY|None|paper")
    states = job_states()
    assert [(job, state.state, state.over) for job, state in states.items()] == [
        ("12_0", "RUNNING", False),
        ("12_1", "PENDING", False),
        ("9", "OUT_OF_MEMORY", True),
    ]
    assert states["12_1"].name == "a|b"


def test_no_answer_is_not_an_empty_queue(program):
    program("squeue", "", code=1)
    with pytest.raises(QueueError):
        job_states()


def test_the_array_limit(program):
    program("scontrol", "MaxArraySize            = 6\nMaxDBDMsgs = 1")
    assert array_limit() == 6


def test_without_an_answer_the_array_limit_is_slurms_default(program):
    assert array_limit() == 1001


def test_jobs_at_once_are_shared_between_arrays():
    assert shares(8, 3) == [3, 3, 2]
    assert shares(5, 1) == [5]
    assert shares(1, 2) == [1, 1]


@pytest.fixture
def submitits(monkeypatch):
    """A handler where submitit's would be; it leaves by ``sys.exit`` as submitit's does."""
    calls = []

    def handler(number, _frame):
        calls.append(number)
        raise SystemExit(-1)

    before = signal.signal(signal.SIGUSR2, handler)
    yield calls
    signal.signal(signal.SIGUSR2, before)


def test_preemption_waits_for_the_checkpoint(submitits):
    with Preemption(signal.SIGUSR2, grace_seconds=60) as preempted:
        assert not preempted()
        os.kill(os.getpid(), signal.SIGUSR2)
        assert preempted() and submitits == []
        with pytest.raises(SystemExit):
            preempted.hand_over()
    assert submitits == [signal.SIGUSR2]
    assert signal.alarm(0) == 0


def test_a_run_that_ends_meanwhile_is_not_requeued(submitits):
    with Preemption(signal.SIGUSR2, grace_seconds=60):
        os.kill(os.getpid(), signal.SIGUSR2)
    assert signal.alarm(0) == 0 and submitits == []


def test_no_batch_boundary_in_time_requeues_all_the_same(submitits, monkeypatch):
    ended = []
    monkeypatch.setattr(os, "_exit", ended.append)
    with Preemption(signal.SIGUSR2, grace_seconds=1):
        os.kill(os.getpid(), signal.SIGUSR2)
        wait_for(lambda: ended, 60, "the end of the grace")
    assert submitits == [signal.SIGUSR2] and ended == [1]


@pytest.mark.parametrize(
    ("argument", "told"),
    [
        ("hydra.launcher.timeout_min=0", "hydra.launcher.timeout_min: should be at least 1, found 0"),
        ("hydra.launcher.mem_gb=-1", "hydra.launcher.mem_gb: should be greater than 0, found -1"),
        ("hydra.launcher.signal_delay_s=100000", "hydra.launcher.signal_delay_s: should be less than the time limit"),
        ("+hydra.launcher.qos=long", "hydra.launcher.additional_parameters"),
    ],
)
def test_a_wrong_key_is_one_sentence(tmp_path, argument, told):
    done = run(tmp_path, "-m", "hydra/launcher=slurm", "protocol=smoke", "dry_run=true", argument)
    assert done.code == 2, done
    assert told in done.err and "Traceback" not in done.err


def test_the_plan_needs_no_slurm(tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    plan = run(tmp_path, "-m", "hydra/launcher=slurm", "protocol=smoke", "seed=range(3)", "dry_run=true")
    assert plan.code == 0, plan
    assert "with 3 at once" in plan.out
    real = run(tmp_path, "-m", "hydra/launcher=slurm", "protocol=smoke", "seed=range(3)")
    assert real.code == 2, real
    assert "sbatch isn't here: run this command on a login node" in real.err


@pytest.mark.parametrize(
    ("left", "slurm", "state", "code"),
    [
        ("complete", "COMPLETED", "complete", 0),
        ("complete", "CANCELLED", "complete", 0),
        ("failed", "FAILED", "failed", 1),
        ("running", "FAILED", "failed", 1),
        ("running", "OUT_OF_MEMORY", "failed", 1),
        ("running", "NODE_FAIL", "failed", 1),
        ("running", "GONE", "failed", 1),
        ("running", "CANCELLED", "interrupted", 75),
        ("running", "TIMEOUT", "interrupted", 75),
        ("running", "COMPLETED", "busy", 75),
        ("interrupted", "COMPLETED", "interrupted", 75),
        ("interrupted", "GONE", "interrupted", 75),
        ("interrupted", "FAILED", "failed", 1),
        (None, "FAILED", "failed", 1),
        (None, "CANCELLED", "interrupted", 75),
    ],
)
def test_manifest_table_and_exit_code_agree(tmp_path, left, slurm, state, code):
    """``left`` is what the job left in the manifest, ``slurm`` what Slurm says of it."""
    config = smoke(tmp_path)
    if left is not None:
        with acquire(config) as (run_directory, _):
            run_directory.update_manifest(status=left, step=2000 if left == "complete" else 500)
    job = GONE if slurm == "GONE" else JobState(slurm, "", "")
    end = result_in_slurm(config, "12_3", job, tmp_path)
    assert end.state == state and exit_code({end.state: 1}) == code
    manifest = RunDirectory(config.path).read_manifest()
    if state in ("complete", "failed") or (left is not None and state == "interrupted"):
        assert manifest is not None and manifest.status == state
    if state == "failed" and left != "failed":
        assert manifest.failure.message.endswith("(Slurm job 12_3)") and end.read.name == "12_3_0_log.err"
