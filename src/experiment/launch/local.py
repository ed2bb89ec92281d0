"""``hydra/launcher=local``: a fresh process per run, so many at once; whatever one does, the others go on.

Each job runs in a session of its own: a Ctrl-C in the terminal reaches only this process, which passes on a SIGTERM and
waits, so that no job is left behind; if this process is killed itself, the kernel sends the jobs their SIGTERM
(see :func:`src.experiment.process.die_with`).
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from contextlib import suppress
from typing import Any

from pydantic import BaseModel, ConfigDict
from rich.console import Console

from src.config.identity import Run
from src.config.schema import Positive, PositiveFloat
from src.experiment.display import SweepDisplay
from src.experiment.machine import usable_cores
from src.experiment.ownership import record_death
from src.experiment.process import thread_environment
from src.experiment.run_directory import RunState
from src.experiment.state import ExitCode, RunResult, result_of
from src.paths import ROOT

_POLL_SECONDS = 0.2


class LocalSettings(BaseModel):
    """The keys of conf/hydra/launcher/local.yaml."""

    model_config = ConfigDict(extra="forbid", strict=True)

    n_jobs: Positive | None
    grace_seconds: PositiveFloat
    hang_minutes: PositiveFloat | None

    def jobs_at_once(self, threads: int) -> int:
        """``n_jobs``, by default as many as the usable cores hold."""
        return self.n_jobs or max(1, usable_cores() // threads)


def run_locally(settings: LocalSettings, runs: Sequence[Run]) -> list[RunResult]:
    """Train runs, each in a process of its own."""
    threads = max((run.config.threads for run in runs), default=1)
    with SweepDisplay(Console(), len(runs)) as display:
        return Pool(settings, settings.jobs_at_once(threads), display).run(runs)


class Job:
    """One running process and its run."""

    def __init__(self, run: Run) -> None:
        self.run = run
        self.started = time.monotonic()
        self.hung = False
        self._sign: tuple[float, object] = (self.started, None)
        self.log = run.path / "state" / "log.txt"
        self.log.parent.mkdir(parents=True, exist_ok=True)
        with self.log.open("ab") as log:
            self.process = subprocess.Popen(
                [sys.executable, "-m", "src.experiment.worker", "--parent", str(os.getpid())],
                stdin=subprocess.PIPE,
                stdout=log,
                stderr=subprocess.STDOUT,
                cwd=ROOT,
                env={**os.environ, **thread_environment(run.config.threads), "PYTHONUNBUFFERED": "1"},
                start_new_session=True,
            )
        assert self.process.stdin is not None
        with suppress(BrokenPipeError), self.process.stdin as pipe:  # it may be dead already; its exit code tells
            pipe.write(json.dumps(run.to_dict()).encode())

    def silent_seconds(self) -> float:
        """Since when the manifest's heartbeat has not moved, on a clock that stops while the machine sleeps."""
        path = self.run.path / "manifest.json"
        try:
            sign: object = path.stat().st_mtime_ns
        except OSError:
            sign = None
        if sign != self._sign[1]:
            self._sign = (time.monotonic(), sign)
        return time.monotonic() - self._sign[0]


class Pool:
    """Starts jobs and waits for them; ``run`` returns how each ended."""

    def __init__(self, settings: LocalSettings, jobs_at_once: int, display: SweepDisplay) -> None:
        self._n_jobs = jobs_at_once
        self._grace_seconds = settings.grace_seconds
        self._hang_seconds = None if settings.hang_minutes is None else settings.hang_minutes * 60
        self._display = display
        self._interrupts = 0
        self._deadline = float("inf")
        self._jobs: list[Job] = []

    def run(self, runs: Sequence[Run]) -> list[RunResult]:
        """Start them in order, wait for all."""
        waiting = list(runs)
        results: list[RunResult] = []
        before = {number: signal.signal(number, self._on_signal) for number in (signal.SIGINT, signal.SIGTERM)}
        try:
            while self._jobs or (waiting and not self._interrupts):
                while waiting and len(self._jobs) < self._n_jobs and not self._interrupts:
                    self._start(waiting.pop(0), results)
                for job in [job for job in self._jobs if job.process.poll() is not None]:
                    self._jobs.remove(job)
                    results.append(self._end(job))
                self._watch()
                self._display.show([job.run for job in self._jobs], len(waiting))
                time.sleep(_POLL_SECONDS)
        finally:
            for job in self._jobs:
                job.process.kill()
                job.process.wait()
            for number, handler in before.items():
                signal.signal(number, handler)
        return results + [RunResult(run, RunState.NOT_STARTED) for run in waiting]

    def _start(self, run: Run, results: list[RunResult]) -> None:
        try:
            job = Job(run)
        except OSError as error:
            results.append(RunResult(run, RunState.FAILED, f"could not be started: {error}"))
            self._display.ended(results[-1], 0.0)
            return
        self._jobs.append(job)
        self._display.started(run)
        if self._interrupts:  # while it was being started
            job.process.terminate()

    def _end(self, job: Job) -> RunResult:
        code = job.process.returncode
        killed = self._cause_of_death(job, code)
        if killed is not None:
            record_death(job.run, killed)
        result = result_of(job.run, killed)
        if code < 0 and killed is None and result.state == RunState.NOT_FINISHED:  # by our signal, too early to record
            result = result._replace(state=RunState.INTERRUPTED, why="")
        if code == ExitCode.BUSY:
            result = result._replace(state=RunState.BUSY, why="another launcher's process holds it")
        elif code == ExitCode.REFUSED:
            result = result._replace(state=RunState.FAILED, why="refused at the start", read=job.log)
        self._display.ended(result, time.monotonic() - job.started)
        return result

    def _cause_of_death(self, job: Job, code: int) -> str | None:
        """None where the job itself has recorded how it ended."""
        if job.hung:
            return "hung: no sign of life, killed by the launcher"
        if code >= 0 or self._interrupts:  # a signal of ours: the run resumes from its last checkpoint
            return None
        name = signal.Signals(-code).name
        return f"killed by {name}" + (" (out of memory?)" if -code == signal.SIGKILL else "")

    def _watch(self) -> None:
        overdue = self._interrupts and (time.monotonic() > self._deadline or self._interrupts > 1)
        for job in self._jobs:
            silent = self._hang_seconds is not None and job.silent_seconds() > self._hang_seconds
            job.hung = job.hung or silent  # a killed job may give a last sign before it dies
            if overdue or job.hung:
                job.process.kill()

    def _on_signal(self, number: int, _frame: Any) -> None:
        self._interrupts += 1
        if self._interrupts > 1:
            return
        self._deadline = time.monotonic() + self._grace_seconds
        for job in self._jobs:
            job.process.terminate()
        self._display.note("stopping: the running jobs take a checkpoint; once more stops them at once")
