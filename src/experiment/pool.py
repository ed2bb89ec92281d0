"""A fresh process per job, so many at once; whatever one of them does, the others go on.

Each job runs in a session of its own: a Ctrl-C in the terminal reaches only this process, which passes on a SIGTERM and
waits, so that no job is left behind; if this process is killed itself, the kernel sends the jobs their SIGTERM
(see :func:`src.job.die_with`).
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from typing import Any

from filelock import Timeout

from src.config import to_dict
from src.experiment import lock
from src.experiment.claim import prepare
from src.experiment.closing import Ending, ending
from src.experiment.decision import Action, Decision
from src.experiment.execute import record_failure
from src.experiment.machine import ROOT
from src.experiment.manifest import ManifestError
from src.experiment.outcome import BUSY, REFUSED
from src.experiment.plan import Cell
from src.experiment.sweep_display import SweepDisplay
from src.experiment.threads import environment

_POLL_SECONDS = 0.2


class Job:
    """One running process and the cell it is at."""

    def __init__(self, cell: Cell) -> None:
        self.cell = cell
        self.started = time.monotonic()
        self._sign: tuple[float, object] = (self.started, None)
        cell.run.state.mkdir(parents=True, exist_ok=True)
        with (cell.run.state / "log.txt").open("ab") as log:
            self.process = subprocess.Popen(
                [sys.executable, "-m", "src.job", "--parent", str(os.getpid())],
                stdin=subprocess.PIPE,
                stdout=log,
                stderr=subprocess.STDOUT,
                cwd=ROOT,
                env={**os.environ, **environment(cell.config.threads), "PYTHONUNBUFFERED": "1"},
                start_new_session=True,
            )
        assert self.process.stdin is not None
        try:
            with self.process.stdin as pipe:
                pipe.write(json.dumps(to_dict(cell.config)).encode())
        except BrokenPipeError:
            pass  # it is dead already; its exit code tells

    def silent_seconds(self) -> float:
        """Since when the manifest's heartbeat has not moved, on a clock that stops while the machine sleeps."""
        path = self.cell.run.path / "manifest.json"
        try:
            sign: object = path.stat().st_mtime_ns
        except OSError:
            sign = None
        if sign != self._sign[1]:
            self._sign = (time.monotonic(), sign)
        return time.monotonic() - self._sign[0]


class Pool:
    """Runs cells; ``run`` returns how each ended."""

    def __init__(self, n_jobs: int, grace_seconds: float, hang_minutes: float | None, display: SweepDisplay) -> None:
        self._n_jobs = n_jobs
        self._grace_seconds = grace_seconds
        self._hang_seconds = None if hang_minutes is None else hang_minutes * 60
        self._display = display
        self._interrupts = 0
        self._deadline = float("inf")
        self._jobs: list[Job] = []
        self._hung: set[int] = set()

    def run(self, cells: Sequence[Cell]) -> list[Ending]:
        """Start them in order, wait for all."""
        waiting = list(cells)
        endings: list[Ending] = []
        before = {number: signal.signal(number, self._on_signal) for number in (signal.SIGINT, signal.SIGTERM)}
        try:
            while self._jobs or (waiting and not self._interrupts):
                while waiting and len(self._jobs) < self._n_jobs and not self._interrupts:
                    self._start(waiting.pop(0), endings)
                for job in [job for job in self._jobs if job.process.poll() is not None]:
                    self._jobs.remove(job)
                    endings.append(self._end(job))
                self._watch()
                self._display.show([job.cell for job in self._jobs], len(waiting))
                time.sleep(_POLL_SECONDS)
        finally:
            for job in self._jobs:
                job.process.kill()
                job.process.wait()
            for number, handler in before.items():
                signal.signal(number, handler)
        endings += [Ending(cell.run.name, "not started", "", cell.run.path) for cell in waiting]
        return endings

    def _start(self, cell: Cell, endings: list[Ending]) -> None:
        try:
            job = Job(cell)
        except OSError as error:
            endings.append(Ending(cell.run.name, "failed", f"could not be started: {error}", cell.run.path))
            self._display.ended(endings[-1], 0.0)
            return
        self._jobs.append(job)
        self._display.started(cell)
        if self._interrupts:  # while it was being started
            job.process.terminate()

    def _end(self, job: Job) -> Ending:
        code = job.process.returncode
        killed = self._cause_of_death(job, code)
        if killed is not None:
            record_death(job.cell, killed)
        end = ending(job.cell, killed)
        if code < 0 and killed is None and end.state == "not finished":  # by our signal, before it could say so
            end = end._replace(state="interrupted", why="")
        if code == BUSY:
            end = end._replace(state="busy", why="another launcher's process holds it")
        elif code == REFUSED:
            end = end._replace(state="failed", why="refused at the start", read=job.cell.run.state / "log.txt")
        self._display.ended(end, time.monotonic() - job.started)
        return end

    def _cause_of_death(self, job: Job, code: int) -> str | None:
        """None where the job itself has recorded how it ended."""
        if job.process.pid in self._hung:
            return "hung: no sign of life, killed by the launcher"
        if code >= 0:
            return None
        if self._interrupts:
            return None  # ours; the run resumes from its last checkpoint
        name = signal.Signals(-code).name
        return f"killed by {name}" + (" (out of memory?)" if -code == signal.SIGKILL else "")

    def _watch(self) -> None:
        if self._interrupts and (time.monotonic() > self._deadline or self._interrupts > 1):
            for job in self._jobs:
                job.process.kill()
        if self._hang_seconds is None:
            return
        for job in self._jobs:
            if job.silent_seconds() > self._hang_seconds:
                self._hung.add(job.process.pid)
                job.process.kill()

    def _on_signal(self, number: int, _frame: Any) -> None:
        self._interrupts += 1
        if self._interrupts > 1:
            return
        self._deadline = time.monotonic() + self._grace_seconds
        for job in self._jobs:
            job.process.terminate()
        self._display.note("stopping: the running jobs take a checkpoint; once more stops them at once")


def record_death(cell: Cell, killed: str, unfinished: Sequence[str] = ("running",)) -> None:
    """Write into the manifest what a dead process could not, unless somebody else has claimed the run meanwhile.

    Args:
        cell: whose process it was.
        killed: what is known of its death.
        unfinished: the manifest's states that this death puts right.
    """
    held = lock.lock_of(cell.run.path)
    try:
        held.acquire(timeout=lock.CLAIM_SECONDS)
    except Timeout:
        return
    try:
        manifest = cell.run.read_manifest()
        if manifest is None:
            prepare(cell.run, cell.config, Decision(Action.RUN))
        elif manifest.status not in unfinished:
            return
        else:
            cell.run.write_manifest(manifest)
        last = cell.run.manifest
        record_failure(cell.run, killed.partition(" (")[0], killed, last.step, last.wall_time_seconds)
    except (OSError, ManifestError) as error:
        print(f"{cell.run.name}: {killed}; that could not be recorded: {error}", file=sys.stderr)
    finally:
        held.release()
