"""Real training on a real Slurm: what clusters do to a job changes no number."""

import subprocess

import pytest

from tests.experiment.command import Done, manifest, run_path
from tests.slurm.cluster import wait_for
from tests.slurm.command import TRAINING, job_of, submit

pytestmark = pytest.mark.slurm
SPIKING = {"label": "bptsan", "encoder": "poisson"}


@pytest.fixture(scope="module")
def grid(running_cluster, tmp_path_factory):
    """Six cells, undisturbed."""
    results = tmp_path_factory.mktemp("grid")
    process = submit(running_cluster, results, *TRAINING, "actor=aan,popsan,bptsan", "seed=0,1")
    return results, Done(process, timeout=300)


def test_a_grid_is_one_array(grid):
    results, done = grid
    assert done.code == 0, done
    assert "finished: 6 complete" in done.out
    jobs = [line.split('"')[3] for line in (results / ".sweeps/slurm/jobs.jsonl").read_text().splitlines()]
    assert len(jobs) == 6 and len({job.split("_")[0] for job in jobs}) == 1
    for actor, encoder in (("aan", "none"), ("popsan", "poisson"), ("bptsan", "poisson")):
        for seed in (0, 1):
            where = {"label": actor, "encoder": encoder}
            assert manifest(results, seed, **where)["status"] == "complete"
            steps = [row.split(",")[0] for row in (run_path(results, seed, **where) / "evaluations.csv").open()][1:]
            assert steps == [str(step) for step in (0, 500, 1000, 1500) for _ in range(2)]


def test_a_job_asks_for_one_core_and_uses_one_thread(grid):
    results, _ = grid
    script = next((results / ".sweeps/slurm").glob("*_submission.sh")).read_text()
    assert "#SBATCH --cpus-per-task=1\n" in script and "export OMP_NUM_THREADS=1\n" in script
    assert manifest(results, 0, **SPIKING)["threads"] == 1


def test_the_same_command_again_has_nothing_to_do(grid, running_cluster):
    results, _ = grid
    again = Done(submit(running_cluster, results, *TRAINING, "actor=aan,popsan,bptsan", "seed=0,1"))
    assert again.code == 0, again
    assert "0 to do, 6 done" in again.out


def test_requeue_preemption_and_a_dead_node_change_no_byte(grid, cluster, tmp_path):
    """``scontrol requeue`` kills (as PreemptMode=REQUEUE does), USR2 asks first, a dead node takes every job."""
    undisturbed, _ = grid
    process = submit(cluster, tmp_path, *TRAINING, "actor=bptsan", "seed=0,1")
    runs = [run_path(tmp_path, seed, **SPIKING) for seed in (0, 1)]

    def reached(step):
        return all((run / "manifest.json").exists() for run in runs) and all(
            manifest(tmp_path, seed, **SPIKING)["step"] >= step for seed in (0, 1)
        )

    def started_again(times):
        cluster.start_requeued()
        return all(manifest(tmp_path, seed, **SPIKING)["times_resumed"] >= times for seed in (0, 1))

    wait_for(lambda: reached(500), 120, "the first checkpoint")
    subprocess.run(["scontrol", "requeue", job_of(tmp_path, runs[0])], env=cluster.environment, check=True)
    subprocess.run(["scancel", "--signal=USR2", job_of(tmp_path, runs[1])], env=cluster.environment, check=True)
    wait_for(lambda: started_again(1), 120, "both to resume")
    preempted_at = manifest(tmp_path, 1, **SPIKING)["step"]

    node = cluster.run("sinfo", "-h", "-o", "%n").strip()
    down = ["scontrol", "update", f"NodeName={node}", "State=DOWN", "Reason=test"]
    subprocess.run(down, env=cluster.environment, check=True)
    resume = ["scontrol", "update", f"NodeName={node}", "State=RESUME"]
    subprocess.run(resume, env=cluster.environment, check=True)
    wait_for(lambda: started_again(2), 120, "both to resume on the node that came back")

    done = Done(process, timeout=240)
    assert done.code == 0, done
    assert preempted_at >= 500
    for seed in (0, 1):
        for name in ("evaluations.csv",):
            ours = (run_path(tmp_path, seed, **SPIKING) / name).read_bytes()
            assert ours == (run_path(undisturbed, seed, **SPIKING) / name).read_bytes()
        assert not (run_path(tmp_path, seed, **SPIKING) / "failure.txt").exists()
