"""Real training on a real Slurm: what clusters do to a job changes no number."""

import subprocess

import pytest

from tests.experiment.command import Done, manifest, run_path
from tests.gate import open_gate, waiting
from tests.slurm.cluster import wait_for
from tests.slurm.command import TRAINING, job_of, log_of, submit

pytestmark = pytest.mark.slurm
SPIKING = {"label": "bptsan", "encoder": "poisson"}


@pytest.fixture(scope="module")
def grid(running_cluster, tmp_path_factory):
    """Six cells, undisturbed."""
    results = tmp_path_factory.mktemp("grid")
    process = submit(running_cluster, results, *TRAINING, "actor=aan,popsan,bptsan", "seed=0,1")
    return results, Done(process, timeout=580)


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
            assert steps == [str(step) for step in (0, 400, 800, 1200) for _ in range(2)]


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


def test_requeue_and_preemption_change_no_byte(grid, cluster, tmp_path, gate):
    """``scontrol requeue`` kills, as PreemptMode=REQUEUE and a dead node do; USR2 asks first."""
    undisturbed, _ = grid
    process = submit(cluster, tmp_path, *TRAINING, "actor=bptsan", "seed=0,1", gate=gate)
    wait_for(lambda: len(waiting(gate, 0, 1)) == 2, 240, "the first checkpoints")
    runs = [run_path(tmp_path, seed, **SPIKING) for seed in (0, 1)]

    def resumed():
        cluster.start_requeued()
        return [manifest(tmp_path, seed, **SPIKING)["times_resumed"] for seed in (0, 1)]

    subprocess.run(["scontrol", "requeue", job_of(tmp_path, runs[0])], env=cluster.environment, check=True)
    subprocess.run(["scancel", "--signal=USR2", job_of(tmp_path, runs[1])], env=cluster.environment, check=True)
    wait_for(lambda: resumed() == [1, 1], 240, "both to resume")
    asked = manifest(tmp_path, 1, **SPIKING)["checkpoint_step"]
    assert asked > 200, "asked, it takes a checkpoint before it leaves"
    open_gate(gate, 0, 1)

    def ended():
        cluster.start_requeued()
        return process.poll() is not None

    wait_for(ended, 480, "the end")
    done = Done(process)
    assert done.code == 0, done
    assert f"resumed at step {asked}\n" in log_of(tmp_path, runs[1]).read_text()
    for seed, run in enumerate(runs):
        expected = run_path(undisturbed, seed, **SPIKING) / "evaluations.csv"
        assert (run / "evaluations.csv").read_bytes() == expected.read_bytes()
        assert not (run / "failure.txt").exists()
