"""Wait for submitted cells. How one stands is read from its manifest; that its job is over, from Slurm's queue.

So nothing waits for an answer that a dead job can't give, and no accounting service is needed. Ctrl-C, or the death of
this process, ends the watching only: the jobs go on.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Mapping
from pathlib import Path

from src.experiment.closing import Ending
from src.experiment.plan import Cell
from src.experiment.slurm.endings import ending_in_slurm
from src.experiment.slurm.queue import GONE, JobState, QueueError, job_states
from src.experiment.sweep_display import SweepDisplay

#: The queue's state is told when it changes, at most this often.
_TELL_SECONDS = 30.0
#: Silence of Slurm is told this often.
_SILENCE_SECONDS = 300.0


class Watch:
    """Follows jobs until the last is over; ``run`` returns how each cell ended."""

    def __init__(self, jobs: Mapping[str, Cell], folder: Path, poll_seconds: float, display: SweepDisplay) -> None:
        self._jobs = dict(jobs)
        self._folder = folder
        self._poll_seconds = poll_seconds
        self._display = display
        self._seen_over: dict[str, str] = {}
        self._began = time.monotonic()
        self._told: tuple[float, str] = (-float("inf"), "")
        self._silent_since = self._began

    def run(self) -> list[Ending]:
        """Wait for all."""
        endings: list[Ending] = []
        try:
            while self._jobs:
                time.sleep(self._poll_seconds)
                endings += self._poll()
        except KeyboardInterrupt:
            self._display.note(
                "the jobs go on in Slurm, and the same command again looks after them; "
                f"`scancel {' '.join(sorted({job.partition('_')[0] for job in self._jobs}))}` would cancel them"
            )
        return endings + left_in_slurm(self._jobs)

    def _poll(self) -> list[Ending]:
        try:
            states = job_states()
        except QueueError as error:
            if time.monotonic() - self._silent_since >= _SILENCE_SECONDS:
                self._silent_since = time.monotonic()
                self._display.note(f"Slurm doesn't answer: {error}")
            return []
        self._silent_since = time.monotonic()
        now = {job: states.get(job, GONE) for job in self._jobs}
        endings = []
        for job, state in now.items():
            if self._is_over(job, state):
                end = ending_in_slurm(self._jobs.pop(job), job, state, self._folder)
                self._display.ended(end, time.monotonic() - self._began)
                endings.append(end)
        self._tell(now)
        return endings

    def _is_over(self, job: str, state: JobState) -> bool:
        """Twice the same answer: a job may be between an end and a requeue, a file server may show an old manifest."""
        if not state.over:
            self._seen_over.pop(job, None)
            return False
        if self._seen_over.get(job) == state.state:
            list(self._jobs[job].run.path.parent.glob("*"))  # has a network file system look again
            return True
        self._seen_over[job] = state.state
        return False

    def _tell(self, now: Mapping[str, JobState]) -> None:
        count = Counter(
            state.state.lower() + (f" ({state.reason})" if state.state == "PENDING" else "")
            for job, state in now.items()
            if job in self._jobs and not state.over
        )
        text = "Slurm: " + ", ".join(f"{number} {what}" for what, number in sorted(count.items()))
        if "held" in text.lower():
            text += "; a held job waits until `scontrol release JOB`"
        if count and text != self._told[1] and time.monotonic() - self._told[0] >= _TELL_SECONDS:
            self._told = (time.monotonic(), text)
            self._display.note(text)


def left_in_slurm(jobs: Mapping[str, Cell]) -> list[Ending]:
    """Cells whose jobs go on without us."""
    return [
        Ending(cell.run.name, "busy", f"in Slurm's hands as job {job}", cell.run.path) for job, cell in jobs.items()
    ]
