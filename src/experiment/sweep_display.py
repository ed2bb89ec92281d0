"""Which cells a sweep is at: a live table on a terminal, a line per finished cell elsewhere. Reads manifests."""

from __future__ import annotations

import time
from collections.abc import Sequence

from rich.console import Console, Group
from rich.live import Live
from rich.table import Table
from rich.text import Text

from src.experiment.closing import Ending
from src.experiment.csv_log import last_return, last_row
from src.experiment.manifest import ManifestError
from src.experiment.plan import Cell
from src.experiment.progress import number, time_left

_REFRESH_SECONDS = 2.0
#: Elsewhere than on a terminal, the running cells are told this often.
_LINE_SECONDS = 300.0


class SweepDisplay:
    """Used by one thread: rich's own refresh thread stays off, because jobs are started from here."""

    def __init__(self, console: Console, cells: int) -> None:
        self._console = console
        self._cells = cells
        self._ended = 0
        self._last = time.monotonic()
        self._live = Live(console=console, auto_refresh=False, transient=True) if console.is_terminal else None

    def __enter__(self) -> SweepDisplay:
        if self._live:
            self._live.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._live:
            self._live.stop()

    def started(self, cell: Cell) -> None:
        """A job has begun."""
        if self._live is None:
            self.note(f"[{self._ended}/{self._cells}] {cell.run.name} started")

    def ended(self, end: Ending, seconds: float) -> None:
        """A job has ended: one line for good."""
        self._ended += 1
        line = f"[{self._ended}/{self._cells}] {end.name} {end.state} {seconds:.0f} s"
        if end.state == "complete":
            line += f" return {number(last_return(end.read / 'evaluations.csv'))}"
        elif end.why:
            line += f" ({end.why})"
        self.note(line)

    def note(self, text: str) -> None:
        """A line for good."""
        self._console.print(text, highlight=False, markup=False, soft_wrap=True)

    def show(self, running: Sequence[Cell], waiting: int) -> None:
        """Refresh, now and then."""
        if time.monotonic() - self._last < (_REFRESH_SECONDS if self._live else _LINE_SECONDS):
            return
        self._last = time.monotonic()
        states = [(cell.run.name, *where(cell)) for cell in running]
        if self._live is None:
            for name, step, rest in states:
                self.note(f"[{self._ended}/{self._cells}] {name} {step} {rest}")
            return
        table = Table(box=None, pad_edge=False)
        for state in states:
            table.add_row(*(Text(part) for part in state))
        head = Text(f"{self._ended} of {self._cells} cells done, {len(running)} running, {waiting} waiting")
        self._live.update(Group(head, table), refresh=True)


def where(cell: Cell) -> tuple[str, str]:
    """How far a running cell is: the steps, and the last return, speed and time left."""
    try:
        manifest = cell.run.read_manifest()
    except (ManifestError, OSError):
        manifest = None
    if manifest is None:
        return "starting", ""
    row = last_row(cell.run.path / "training.csv")
    rate = float(row.get("steps_per_second") or 0) if row else 0.0
    left = time_left(manifest.total_steps - manifest.step, rate)
    shown = number(last_return(cell.run.path / "evaluations.csv"))
    return f"{manifest.step}/{manifest.total_steps}", f"return {shown}  {rate:.0f} steps/s  {left} left"
