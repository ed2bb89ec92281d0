"""However a job ends, manifest, closing table and exit code say the same, and nothing waits for ever."""

import re
import subprocess

import pytest

from tests.experiment.command import Done, calls, manifest, run_path
from tests.gate import open_gate, waiting
from tests.slurm.cluster import wait_for
from tests.slurm.command import job_of, submit

pytestmark = pytest.mark.slurm


def test_a_failing_cell_and_one_that_dies_without_a_word(cluster, tmp_path):
    grid = ("protocol=smoke", "seed=range(3)")
    done = Done(submit(cluster, tmp_path, *grid, stub={"0": "raise", "1": "kill"}), timeout=240)
    assert done.code == 1, done
    assert manifest(tmp_path, 0)["failure"]["message"] == "RuntimeError: boom"
    assert manifest(tmp_path, 1)["status"] == "failed"
    assert manifest(tmp_path, 1)["failure"]["kind"] == "its job ended in Slurm as FAILED"
    assert manifest(tmp_path, 2)["status"] == "complete"
    table = done.out[done.out.index("finished:") :]
    assert re.search(
        r"^failed +td3/hopper/bptsan/poisson/seed_0  RuntimeError: boom\n +read \S+failure.txt", table, re.M
    )
    assert re.search(r"^failed +td3/hopper/bptsan/poisson/seed_1 .*Slurm as FAILED.*\n +read \S+_log.err", table, re.M)
    states = cluster.run("squeue", "-h", "-r", "-t", "all", "-o", "%T", "-j", job_of(tmp_path, run_path(tmp_path, 0)))
    assert states.split() == ["FAILED"]

    again = Done(submit(cluster, tmp_path, *grid, stub={}), timeout=240)
    assert again.code == 0, again
    assert "finished: 2 complete" in again.out


def test_a_cancelled_task_takes_no_other_with_it(cluster, tmp_path, gate):
    grid = ("protocol=smoke", "seed=range(3)")  # two cores: the third waits
    process = submit(cluster, tmp_path, *grid, stub={"gate": str(gate)})
    wait_for(lambda: len(waiting(gate, 0, 1)) == 2, 120, "two jobs")
    for seed in (1, 2):
        job = job_of(tmp_path, run_path(tmp_path, seed))
        subprocess.run(["scancel", job], env=cluster.environment, check=True)
    open_gate(gate, 0)
    done = Done(process, timeout=240)
    assert done.code == 75, done
    assert "2 interrupted" in done.out and "1 complete" in done.out
    assert done.out.count("cancelled in Slurm") == 2
    assert manifest(tmp_path, 0)["status"] == "complete"
    assert manifest(tmp_path, 1)["status"] == "interrupted"
    again = Done(submit(cluster, tmp_path, *grid, stub={}), timeout=240)
    assert again.code == 0, again


def test_a_time_limit_is_a_checkpoint_and_a_requeue(cluster, tmp_path, gate):
    """One minute is Slurm's shortest limit; it warns up to half a minute early."""
    process = submit(
        cluster,
        tmp_path,
        "protocol=smoke",
        "hydra.launcher.timeout_min=1",
        "hydra.launcher.signal_delay_s=20",
        "seed=0",
        stub={"gate": str(gate)},
    )

    def ended():
        cluster.start_requeued()
        if (run_path(tmp_path) / "state" / "calls").exists() and len(calls(tmp_path)) == 2:  # it has come back
            open_gate(gate, 0)
        return process.poll() is not None

    wait_for(ended, 240, "the end")
    done = Done(process)
    assert done.code == 0, done
    assert manifest(tmp_path)["status"] == "complete"
    starts = [int(line.split()[-1]) for line in calls(tmp_path)]
    assert starts == [0, 1000], "the warning makes it take a checkpoint"
    steps = [int(row.split(",")[0]) for row in (run_path(tmp_path) / "training.csv").read_text().splitlines()[1:]]
    assert steps == [500, 1000, 1500, 2000]


def test_a_node_that_dies_takes_its_jobs_and_they_come_back(cluster, tmp_path, gate):
    process = submit(cluster, tmp_path, "protocol=smoke", "seed=0,1", stub={"gate": str(gate)})
    wait_for(lambda: len(waiting(gate, 0, 1)) == 2, 120, "two runs")
    node = ["scontrol", "update", "NodeName=" + cluster.run("sinfo", "-h", "-o", "%n").strip()]
    subprocess.run([*node, "State=DOWN", "Reason=test"], env=cluster.environment, check=True)
    # this node only pretends: as long as it has the old jobs' daemons it can't start the new ones
    wait_for(lambda: not cluster.job_daemons(), 60, "the jobs to die")
    open_gate(gate, 0, 1)
    subprocess.run([*node, "State=RESUME"], env=cluster.environment, check=False)  # unless it has come back by itself

    def ended():
        cluster.start_requeued()
        return process.poll() is not None

    wait_for(ended, 240, "the end")
    done = Done(process)
    assert done.code == 0, done
    for seed in (0, 1):
        first, second = (int(line.split()[-1]) for line in calls(tmp_path, seed))
        assert (first, second) == (0, 500)
        rows = (run_path(tmp_path, seed) / "training.csv").read_text().splitlines()[1:]
        assert [int(row.split(",")[0]) for row in rows] == [500, 1000, 1500, 2000]


def test_no_time_outs_left_is_interrupted_not_failed(cluster, tmp_path, gate):
    process = submit(
        cluster,
        tmp_path,
        "protocol=smoke",
        "hydra.launcher.timeout_min=1",
        "hydra.launcher.max_num_timeout=0",
        "seed=0",
        "hydra.launcher.signal_delay_s=20",
        stub={"gate": str(gate)},
    )
    wait_for(lambda: waiting(gate, 0), 120, "a checkpoint")
    # every end of a one-minute job counts as a time-out
    subprocess.run(
        ["scancel", "--signal=USR2", job_of(tmp_path, run_path(tmp_path))], env=cluster.environment, check=True
    )
    done = Done(process, timeout=240)
    assert done.code == 75, done
    assert manifest(tmp_path)["status"] == "interrupted"
    assert Done(submit(cluster, tmp_path, "protocol=smoke", stub={})).code == 0
    assert len(calls(tmp_path)) == 2
