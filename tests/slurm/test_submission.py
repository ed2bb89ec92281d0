"""What is submitted, when, and what is left alone."""

import json
import os
import signal

import pytest

from tests.experiment.command import Done, calls, manifest
from tests.gate import open_gate, waiting
from tests.slurm.cluster import ARRAY_LIMIT, wait_for
from tests.slurm.command import submit

pytestmark = pytest.mark.slurm


def test_more_cells_than_an_array_takes(cluster, tmp_path):
    """Three arrays; a failure in the first holds nothing up."""
    cells = 2 * ARRAY_LIMIT + 1
    done = Done(submit(cluster, tmp_path, "protocol=smoke", f"seed=range({cells})", stub={"0": "raise"}), timeout=300)
    assert done.code == 1, done
    assert f"finished: {cells - 1} complete, 1 failed" in done.out or f"1 failed, {cells - 1} complete" in done.out
    lines = (tmp_path / ".sweeps/slurm/jobs.jsonl").read_text().splitlines()
    assert len({json.loads(line)["job"].split("_")[0] for line in lines}) == 3


def test_the_submitting_shell_goes_away(cluster, tmp_path, gate):
    grid = ("protocol=smoke", "seed=range(4)")
    first = submit(cluster, tmp_path, *grid, stub={"gate": str(gate)})
    wait_for(lambda: len(waiting(gate, 0, 1)) == 2, 120, "two running jobs")
    os.killpg(first.pid, signal.SIGKILL)
    Done(first)

    second = Done(submit(cluster, tmp_path, *grid, stub={}))
    assert second.code == 75, second
    assert "2 busy" in second.out and "2 runs in Slurm's queue already" in second.out
    assert "submitted" not in second.out

    open_gate(gate, *range(4))
    wait_for(lambda: not cluster.jobs(), 120, "the jobs of the first command")
    third = Done(submit(cluster, tmp_path, *grid, stub={}))
    assert third.code == 0, third
    assert [len(calls(tmp_path, seed)) for seed in range(4)] == [1, 1, 1, 1]


def test_ctrl_c_ends_the_watching_only(cluster, tmp_path, gate):
    process = submit(cluster, tmp_path, "protocol=smoke", "seed=0", stub={"gate": str(gate)})
    wait_for(lambda: waiting(gate, 0), 120, "the job")
    process.send_signal(signal.SIGINT)
    done = Done(process)
    assert done.code == 75, done
    assert "the jobs go on in Slurm" in done.out
    open_gate(gate, 0)
    wait_for(lambda: not cluster.jobs(), 60, "the job's end")
    assert manifest(tmp_path)["status"] == "complete"


def test_submit_and_leave(cluster, tmp_path):
    done = Done(submit(cluster, tmp_path, "protocol=smoke", "seed=0,1", "hydra.launcher.wait=false", stub={}))
    assert done.code == 75, done
    wait_for(lambda: not cluster.jobs(), 60, "the jobs' end")
    assert [manifest(tmp_path, seed)["status"] for seed in (0, 1)] == ["complete", "complete"]


def test_what_slurm_refuses_is_one_sentence(cluster, tmp_path):
    done = Done(submit(cluster, tmp_path, "protocol=smoke", "hydra.launcher.partition=nowhere", stub={}))
    assert done.code == 2, done
    assert "invalid partition specified: nowhere" in done.err
    assert "Traceback" not in done.err
