"""How far a run is, as the training reports it: a live bar on a terminal, plain lines elsewhere, a heartbeat."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Protocol

from rich.console import Console
from rich.progress import BarColumn, TextColumn
from rich.progress import Progress as Bar

from src.experiment.run_directory import RunDirectory

#: Plain lines come at most this often.
LINE_SECONDS = 30.0
#: The heartbeat in the manifest comes at most this often.
HEARTBEAT_SECONDS = 15.0


class Progress(Protocol):
    """What the training calls: after every collector batch or so; it is cheap."""

    def update(self, step: int, last_return: float | None, steps_per_second: float) -> None:
        """``step`` environment steps are done; ``last_return`` is the mean return of the last evaluation."""

    def note(self, text: str) -> None:
        """Something that a person should know."""


class PlainProgress:
    """A line now and then, for logs and pipes."""

    def __init__(self, total_steps: int) -> None:
        self._total = total_steps
        self._last = -float("inf")

    def update(self, step: int, last_return: float | None, steps_per_second: float) -> None:
        """Print a line at most every :data:`LINE_SECONDS`, and at the end."""
        now = time.monotonic()
        if now - self._last < LINE_SECONDS and step < self._total:
            return
        self._last = now
        self.note(f"step {step}/{self._total}  {pace(last_return, steps_per_second, self._total - step)}")

    def note(self, text: str) -> None:
        """Print it."""
        print(text, flush=True)


class LiveProgress:
    """A bar on a terminal."""

    def __init__(self, bar: Bar, total_steps: int) -> None:
        self._bar = bar
        self._total = total_steps
        self._task = bar.add_task("", total=total_steps, status="starting")

    def update(self, step: int, last_return: float | None, steps_per_second: float) -> None:
        """Move the bar."""
        status = pace(last_return, steps_per_second, self._total - step)
        self._bar.update(self._task, completed=step, status=status)

    def note(self, text: str) -> None:
        """Print it above the bar."""
        say(self._bar.console, text)


class Heartbeat:
    """Hands everything on and keeps ``step``, ``wall_time_seconds`` and ``updated`` of the manifest fresh."""

    def __init__(self, run: RunDirectory, inner: Progress) -> None:
        self._run = run
        self._inner = inner
        self.step = run.manifest.step
        self._before = run.manifest.wall_time_seconds
        self._began = self._last = time.monotonic()

    @property
    def wall_time_seconds(self) -> float:
        """Time spent, over all resumes."""
        return round(self._before + time.monotonic() - self._began, 3)

    def update(self, step: int, last_return: float | None, steps_per_second: float) -> None:
        """Every update is shown; the manifest follows at most every :data:`HEARTBEAT_SECONDS`."""
        self.step = step
        self._inner.update(step, last_return, steps_per_second)
        if time.monotonic() - self._last >= HEARTBEAT_SECONDS:
            self._last = time.monotonic()
            self._run.update_manifest(step=step, wall_time_seconds=self.wall_time_seconds)

    def note(self, text: str) -> None:
        """Shown and logged."""
        self._inner.note(text)
        self._run.log.info(text)


@contextmanager
def display(total_steps: int) -> Iterator[Progress]:
    """A live bar on a terminal, plain lines elsewhere."""
    console = Console()
    if not console.is_terminal:
        yield PlainProgress(total_steps)
        return
    columns = (BarColumn(), TextColumn("step {task.completed}/{task.total}  {task.fields[status]}"))
    with Bar(*columns, console=console, refresh_per_second=4) as bar:
        yield LiveProgress(bar, total_steps)


def say(console: Console, text: str) -> None:
    """Print text as it is (no colours, emoji, wrapped lines), so that a path can be copied and a line searched for."""
    console.print(text, highlight=False, markup=False, emoji=False, soft_wrap=True)


def pace(last_return: float | None, steps_per_second: float, steps_left: int) -> str:
    """``return 12.3  85 steps/s  4 min left``."""
    return (
        f"return {number(last_return)}  {steps_per_second:.0f} steps/s  {time_left(steps_left, steps_per_second)} left"
    )


def number(value: float | None) -> str:
    """A return for people."""
    return "-" if value is None else f"{value:.1f}"


def time_left(steps: int, steps_per_second: float) -> str:
    """``3 h 20 min``, ``4 min``, ``30 s``, or ``?``."""
    if steps <= 0:
        return "0 s"
    return duration(steps / steps_per_second) if steps_per_second > 0 else "?"


def duration(seconds: float) -> str:
    """Seconds for people."""
    if seconds < 90:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60)
    return f"{minutes} min" if minutes < 90 else f"{minutes // 60} h {minutes % 60:02d} min"
