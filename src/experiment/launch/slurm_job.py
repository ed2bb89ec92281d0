"""What one Slurm job does: train one run. Submitit pickles :class:`Task` (by reference) and the run's plain content.

Slurm sends USR2 some time before a time limit, or when it preempts a job. Submitit's handler then resubmits the same
call, requeues the job and leaves by ``sys.exit``, in the middle of whatever the run is doing. We let the run stop at
its next batch boundary first, with a checkpoint, and call that handler then: no step is lost, and the exit is no
failure of the run. Submitit's other handlers (TERM and CONT are ignored) stay as they are.
"""

from __future__ import annotations

import os
import signal
import sys
import time
from types import FrameType
from typing import Any

from submitit.core.utils import DelayedSubmission, UncompletedJobError
from submitit.slurm.slurm import SlurmJobEnvironment

from src.config.identity import Run
from src.experiment.progress import PlainProgress
from src.experiment.run_directory import RunState
from src.experiment.state import FRESH_SECONDS, Outcome
from src.experiment.worker import execute

_RETRY_SECONDS = 10.0


class Task:
    """``Task(grace_seconds)(content)`` trains the run whose plain content is ``content``."""

    def __init__(self, grace_seconds: int) -> None:
        self.grace_seconds = grace_seconds

    def __call__(self, content: dict[str, Any]) -> str:
        """Train the run from wherever it stands and return its state.

        Raises:
            RunFailedError: the run failed and has recorded why; Slurm shows the job as FAILED.
            SystemExit: submitit has requeued the job.
        """
        run = Run.from_dict(content)
        with Preemption(SlurmJobEnvironment._usr_sig(), self.grace_seconds) as preempted:
            outcome = _execute(run, preempted)
            if outcome.status == RunState.INTERRUPTED and preempted():
                try:
                    preempted.hand_over()
                except UncompletedJobError as error:  # no time-outs left: no failure of the run, which can go on
                    print(error, flush=True)
        print(f"{outcome.status} at step {outcome.step} {outcome.message}", flush=True)
        return outcome.status

    def checkpoint(self, content: dict[str, Any]) -> DelayedSubmission:
        """Submitit's own call: the same again, because all state is in the run directory."""
        return DelayedSubmission(self, content)


class Preemption:
    """Callable that says whether a stop has been asked for; a context in which the signal is put off."""

    def __init__(self, number: int, grace_seconds: int) -> None:
        self._number = number
        self._grace_seconds = grace_seconds
        self._asked = False

    def __enter__(self) -> Preemption:
        self._submitits: Any = signal.signal(self._number, self._on_signal)
        self._alarms: Any = signal.signal(signal.SIGALRM, self._on_alarm)
        return self

    def __exit__(self, *_: object) -> None:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, self._alarms)
        signal.signal(self._number, self._submitits)

    def __call__(self) -> bool:
        """Whether a stop has been asked for."""
        return self._asked

    def hand_over(self) -> None:
        """Let submitit requeue the job.

        Raises:
            SystemExit: it is requeued.
            UncompletedJobError: it has used up its time-outs.
        """
        signal.alarm(0)
        self._submitits(self._number, None)

    def _on_signal(self, _number: int, _frame: FrameType | None) -> None:
        self._asked = True
        signal.alarm(self._grace_seconds)

    def _on_alarm(self, _number: int, _frame: FrameType | None) -> None:
        """No batch boundary in time: requeue now and end as if killed; the last checkpoint counts."""
        try:
            self.hand_over()
        except SystemExit:
            sys.stdout.flush()
            os._exit(1)


def _execute(run: Run, preempted: Preemption) -> Outcome:
    """Where the job was requeued, a file server may hold the lock of its dead process a while longer: try again."""
    requeued = int(os.environ.get("SLURM_RESTART_COUNT") or 0) > 0
    deadline = time.monotonic() + (FRESH_SECONDS if requeued else 0.0)
    while True:
        outcome = execute(run, PlainProgress(run.config.protocol.total_steps), preempted)
        if outcome.status != RunState.BUSY or time.monotonic() >= deadline:
            return outcome
        print(f"{outcome.message}; trying again", flush=True)
        time.sleep(_RETRY_SECONDS)
