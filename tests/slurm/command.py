"""``python -m src.run -m hydra/launcher=slurm`` as a user types it, with the real trainer or the pretending one."""

import json
import os
import subprocess
import sys

from tests import gate as gates
from tests.experiment.command import ROOT, STUB

#: Real training, small: every phase of the protocol, and six checkpoints.
TRAINING = (
    "protocol=smoke",
    "protocol.total_steps=1200",
    "protocol.start_steps=150",
    "protocol.update_after=100",
    "protocol.evaluation_interval=400",
    "protocol.checkpoint_interval=200",
    "algo.batch_size=16",
    "algo.critic_hidden_sizes=[32,32]",
    "actor.hidden_sizes=[32,32]",
    "env.max_episode_steps=100",
    "label=${actor.name}",
    "logger=none",
)
QUICK = ("hydra/launcher=slurm", "hydra.launcher.poll_seconds=0.5", "hydra.launcher.mem_gb=1")


def submit(cluster, results, *arguments, stub=None, gate=None):
    """Start the command; ``stub`` is a plan for the pretending trainer (see tests/experiment/stub).

    ``gate`` is the folder of a gate at which the real trainer waits from its first checkpoint on (see tests/gate).
    """
    environment = {**cluster.environment, "COLUMNS": "200"}
    if gate is not None:
        environment |= gates.environment(gate, 200)
    if stub is not None:
        environment |= {"PYTHONPATH": f"{STUB}{os.pathsep}{ROOT}", "STUB": json.dumps(stub)}
    return subprocess.Popen(
        [sys.executable, "-m", "src.run", "-m", *QUICK, *arguments, f"results_dir={results}"],
        cwd=ROOT,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def job_of(results, run):
    """The Slurm job that was submitted last for this run directory."""
    jobs = {}
    for line in (results / ".sweeps" / "slurm" / "jobs.jsonl").read_text().splitlines():
        entry = json.loads(line)
        jobs[(results / ".sweeps" / "slurm" / entry["run"]).resolve()] = entry["job"]
    return jobs[run.resolve()]


def log_of(results, run):
    """What that job has printed."""
    return results / ".sweeps" / "slurm" / f"{job_of(results, run)}_0_log.out"
