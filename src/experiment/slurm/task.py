"""What one Slurm job does: run one cell. Submitit pickles this object (by reference) and the cell's configuration."""

from __future__ import annotations

import os
import time
from typing import Any

from submitit.core.utils import DelayedSubmission, UncompletedJobError
from submitit.slurm.slurm import SlurmJobEnvironment

from src.config import ExperimentConfig, validate
from src.experiment.claim import BusyError
from src.experiment.execute import execute
from src.experiment.lock import FRESH_SECONDS
from src.experiment.outcome import Outcome
from src.experiment.progress import PlainProgress
from src.experiment.slurm.preemption import Preemption

_RETRY_SECONDS = 10.0


class Task:
    """``Task(grace_seconds)(content)`` runs the cell whose resolved configuration is ``content``."""

    def __init__(self, grace_seconds: int) -> None:
        self.grace_seconds = grace_seconds

    def __call__(self, content: dict[str, Any]) -> str:
        """Run the cell from wherever it stands and return its status.

        Raises:
            RunFailedError: the run failed and has recorded why; Slurm shows the job as FAILED.
            SystemExit: submitit has requeued the job.
        """
        config = validate(content)
        with Preemption(SlurmJobEnvironment._usr_sig(), self.grace_seconds) as preempted:
            try:
                outcome = _execute(config, preempted)
            except BusyError as busy:
                print(busy, flush=True)
                return "busy"
            if outcome.status == "interrupted" and preempted():
                try:
                    preempted.hand_over()
                except UncompletedJobError as error:  # no time-outs left: no failure of the run, which can go on
                    print(error, flush=True)
        print(f"{outcome.status} at step {outcome.step} {outcome.message}", flush=True)
        return outcome.status

    def checkpoint(self, content: dict[str, Any]) -> DelayedSubmission:
        """Submitit's own call: the same again, because all state is in the run directory."""
        return DelayedSubmission(self, content)


def _execute(config: ExperimentConfig, preempted: Preemption) -> Outcome:
    """Where the job was requeued, a file server may hold the lock of its dead process a while longer: try again."""
    deadline = time.monotonic() + (FRESH_SECONDS if was_requeued() else 0.0)
    while True:
        try:
            return execute(config, PlainProgress(config.protocol.total_steps), preempted)
        except BusyError as busy:
            if time.monotonic() >= deadline:
                raise
            print(f"{busy}; trying again", flush=True)
            time.sleep(_RETRY_SECONDS)


def was_requeued() -> bool:
    """Whether this job has been started before."""
    return int(os.environ.get("SLURM_RESTART_COUNT") or 0) > 0
