"""What a person sees of a grid: the plan before it, the runs while it goes on, the summary at its end."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Sequence

from rich.console import Console, Group
from rich.filesize import decimal
from rich.live import Live
from rich.table import Table
from rich.text import Text

from src.config.identity import Run
from src.experiment.cost import cost
from src.experiment.files import last_return, last_speed
from src.experiment.plan import NAMED, Plan, check_writable, make_plan
from src.experiment.progress import duration, number, pace, say
from src.experiment.run_directory import ManifestError, RunDirectory, RunState
from src.experiment.state import ExitCode, Next, RunResult, exit_code
from src.paths import shown_path

_REFRESH_SECONDS = 2.0
#: Elsewhere than on a terminal, the running runs are listed this often.
_LINE_SECONDS = 300.0


def announced(runs: Sequence[Run], console: Console, jobs_at_once: int, trains_here: bool = False) -> Plan | None:
    """Plan a grid and print the plan; None where ``dry_run`` asks for no more than that and its cost.

    Raises:
        ConfigurationError: as :func:`src.experiment.plan.make_plan`, or the results can't be written.
    """
    plan = make_plan(runs, trains_here)
    dry = any(run.config.dry_run for run in runs)
    _show_plan(plan, console)
    if dry and plan.to_do:
        _show_cost(plan, console, min(jobs_at_once, len(plan.to_do)))
    if dry:
        return None
    check_writable(runs[0].config)
    return plan


def _show_plan(plan: Plan, console: Console) -> None:
    """What will be done: a line per group of seeds, then the runs that need a word."""
    counts = Counter(each.action for each in plan.runs)
    studies = sorted({shown_path(each.run.path.parents[5]) for each in plan.runs})
    say(
        console,
        f"{len(plan.runs)} run{'s' * (len(plan.runs) != 1)} in {', '.join(studies)}: {len(plan.to_do)} to do, "
        f"{counts[Next.SKIP] + counts[Next.DIVERGED]} done, {counts[Next.BUSY]} busy",
    )
    if len(plan.runs) > 1:
        console.print(_plan_table(plan, [action for action in Next if counts[action]]))
    else:
        say(console, shown_path(plan.runs[0].run.path))
    for action in (each for each in Next if each not in (Next.RUN, Next.SKIP)):
        concerned = plan.having(action)
        for each in concerned[:NAMED]:
            say(console, f"{action}: {each.run.name} ({each.reason})")
        if len(concerned) > NAMED:
            say(console, f"... and {len(concerned) - NAMED} more to {action}")


def _plan_table(plan: Plan, present: Sequence[Next]) -> Table:
    table = Table(box=None, pad_edge=False, header_style="bold")
    for column in ("algo", "env", "actor", "encoder"):
        table.add_column(column, overflow="fold")
    for action in present:
        table.add_column(action.value, justify="right")
    groups: dict[tuple[str, ...], Counter[Next]] = {}
    for each in plan.runs:
        groups.setdefault(each.run.path.parts[-5:-1], Counter())[each.action] += 1
    for names, actions in groups.items():
        table.add_row(*names, *(str(actions[action] or "") for action in present))
    return table


def _show_cost(plan: Plan, console: Console, jobs_at_once: int) -> None:
    estimate = cost([(each.run.config, each.step) for each in plan.to_do], jobs_at_once)
    basis = (
        "from the runs in the results folder" if estimate.measured else "rough: some rates are defaults, not measured"
    )
    say(
        console,
        f"about {duration(estimate.clock_hours * 3600)} with {jobs_at_once} at once, "
        f"{estimate.core_hours:.1f} core-hours ({basis})\n"
        f"about {decimal(estimate.peak_bytes)} of disk for replay at the peak, "
        f"{decimal(estimate.kept_bytes)} of it kept at the end",
    )


class SweepDisplay:
    """A live table on a terminal, a line per finished run elsewhere.

    Used by one thread: rich's own refresh thread stays off, because jobs are started from here.
    """

    def __init__(self, console: Console, runs: int) -> None:
        self._console = console
        self._runs = runs
        self._ended = 0
        self._last = time.monotonic()
        self._live = Live(console=console, auto_refresh=False, transient=True)  # shows nothing but on a terminal

    def __enter__(self) -> SweepDisplay:
        self._live.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._live.stop()

    def started(self, run: Run) -> None:
        """A job has begun."""
        if not self._console.is_terminal:
            self.note(f"[{self._ended}/{self._runs}] {run.name} started")

    def ended(self, result: RunResult, seconds: float) -> None:
        """A job has ended: one permanent line."""
        self._ended += 1
        line = f"[{self._ended}/{self._runs}] {result.run.name} {result.state} {seconds:.0f} s"
        if result.state == RunState.COMPLETE:
            line += f" return {number(last_return(result.run.path / 'evaluations.csv'))}"
        elif result.why:
            line += f" ({result.why})"
        self.note(line)

    def note(self, text: str) -> None:
        """One permanent line."""
        say(self._console, text)

    def show(self, running: Sequence[Run], waiting: int) -> None:
        """Refresh, if the last time was long enough ago."""
        if time.monotonic() - self._last < (_REFRESH_SECONDS if self._console.is_terminal else _LINE_SECONDS):
            return
        self._last = time.monotonic()
        rows = [(each.name, *_how_far(each)) for each in running]
        if not self._console.is_terminal:
            for row in rows:
                self.note(f"[{self._ended}/{self._runs}] {' '.join(row)}")
            return
        table = Table(box=None, pad_edge=False)
        for row in rows:
            table.add_row(*(Text(part) for part in row))
        head = Text(f"{self._ended} of {self._runs} runs done, {len(running)} running, {waiting} waiting")
        self._live.update(Group(head, table), refresh=True)


def _how_far(run: Run) -> tuple[str, str]:
    """The steps of a running run, and its last return, speed and time left."""
    try:
        manifest = RunDirectory(run.path).read_manifest()
    except (ManifestError, OSError):
        manifest = None
    if manifest is None:
        return "starting", ""
    speed = last_speed(run.path / "training.csv")
    shown = pace(last_return(run.path / "evaluations.csv"), speed, manifest.total_steps - manifest.step)
    return f"{manifest.step}/{manifest.total_steps}", shown


def show_summary(results: Sequence[RunResult], busy_before: int, console: Console) -> ExitCode:
    """Print what is not well, each with where to read why, and return the exit code of the sweep."""
    count = Counter(result.state for result in results)
    parts = [f"{number} {state}" for state, number in count.items()]
    if busy_before:
        parts.append(f"{busy_before} left to another launcher")
        count[RunState.BUSY] += busy_before
    say(console, f"finished: {', '.join(parts)}")
    well = (RunState.COMPLETE, RunState.INTERRUPTED, RunState.NOT_STARTED)
    unwell = [result for result in results if result.state not in well]
    width = max((len(result.state) for result in unwell), default=0)
    for result in unwell:
        say(console, f"{result.state:{width}}  {result.run.name}  {result.why}")
        say(console, f"{'':{width}}  read {shown_path(result.read or result.run.path)}")
    return exit_code(count)
