"""Submitit's preemption signal, put off until the run has written a checkpoint.

Slurm sends USR2 some time before a time limit, or when it preempts a job. Submitit's handler then resubmits the same
call, requeues the job and leaves by ``sys.exit``, in the middle of whatever the run is doing. We let the run stop at
its next batch boundary first, with a checkpoint, and call that handler then: no step is lost, and the exit is no
failure of the run. Submitit's other handlers (TERM and CONT are ignored) stay as they are.
"""

from __future__ import annotations

import os
import signal
import sys
from types import FrameType
from typing import Any


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
