"""The grid of a study as a table: ``python -m src.status results/paper``. Reads files only, never torch.

Exit codes: 0 every run there is has ended well (complete or diverged) and no seed is missing, 1 a run failed or the
seeds of one row are not one configuration, 75 something is running, interrupted or missing, 2 there is no such study.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path
from statistics import fmean
from typing import Any, NamedTuple

from rich.console import Console
from rich.table import Table

from src.config.identity import Difference, differences
from src.experiment.files import last_speed, mean_returns
from src.experiment.plan import compared_on_disk
from src.experiment.progress import duration, number, say
from src.experiment.run_directory import RunState
from src.experiment.state import ExitCode, exit_code, inspect_run
from src.paths import repository_path


class SeedStatus(NamedTuple):
    """How far one run is."""

    seed: int
    state: RunState
    step: int
    total_steps: int
    last_return: float | None  # mean of the newest evaluation's episodes
    final_return: float | None  # of a complete run: mean of the evaluations in the last 10 % of its steps
    steps_per_second: float | None  # of the last interval; of a complete run over all
    why: str

    @property
    def seconds_left(self) -> float | None:
        """At the speed of the last interval; None where that isn't known."""
        if self.state == RunState.COMPLETE:
            return 0.0
        return (self.total_steps - self.step) / self.steps_per_second if self.steps_per_second else None


class Row(NamedTuple):
    """All seeds of one configuration."""

    algo: str
    env: str
    label: str
    encoder: str
    runs: tuple[SeedStatus, ...]
    missing: tuple[int, ...]  # seeds that other rows of the study have
    mixed: str  # what the seeds differ in besides the seed, as a sentence

    @property
    def name(self) -> str:
        """``td3/hopper/bptsan/poisson``."""
        return "/".join((self.algo, self.env, self.label, self.encoder))

    def seeds(self, state: RunState) -> tuple[int, ...]:
        """Seeds of the runs in this state."""
        return tuple(run.seed for run in self.runs if run.state == state)


def read_study(study: Path) -> list[Row]:
    """The grid of ``results/<study>``, in alphabetical order.

    Raises:
        FileNotFoundError: there is no such study, or nothing in it.
    """
    if not study.is_dir():
        raise FileNotFoundError(f"{study}: there is no such study; results/<study> is made by the first run.")
    folders: dict[tuple[str, ...], list[Path]] = {}
    for path in sorted((study / "runs").glob("*/*/*/*/seed_*")):
        if (path / "manifest.json").exists() or (path / "state").is_dir():
            folders.setdefault(path.parts[-5:-1], []).append(path)
    if not folders:
        raise FileNotFoundError(f"{study}: there are no runs in it yet.")
    seeds = {_seed(path) for paths in folders.values() for path in paths}
    rows = []
    for (algo, env, label, encoder), paths in folders.items():
        runs = tuple(sorted(_seed_status(path) for path in paths))
        missing = tuple(sorted(seeds - {run.seed for run in runs}))
        rows.append(Row(algo, env, label, encoder, runs, missing, _mixed(paths)))
    return rows


def _seed(path: Path) -> int:
    return int(path.name.removeprefix("seed_"))


def _seed_status(path: Path) -> SeedStatus:
    seen = inspect_run(path)
    if seen.manifest is None:
        return SeedStatus(_seed(path), seen.state, 0, 0, None, None, None, seen.why)
    rate = last_speed(path / "training.csv")
    if seen.state == RunState.COMPLETE and seen.manifest.wall_time_seconds > 0:
        rate = seen.step / seen.manifest.wall_time_seconds
    total = seen.manifest.total_steps
    returns = mean_returns(path / "evaluations.csv")
    newest = returns[max(returns)] if returns else None
    final = _mean(mean for step, mean in returns.items() if seen.state == RunState.COMPLETE and step > 0.9 * total)
    return SeedStatus(_seed(path), seen.state, seen.step, total, newest, final, rate or None, seen.why)


def _mean(values: Iterable[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return fmean(known) if known else None


def _mixed(paths: Sequence[Path]) -> str:
    """What the first seed that differs from the one before it differs in."""
    first: tuple[Path, dict[str, Any]] | None = None
    for path in paths:
        content = compared_on_disk(path)
        if content is None:
            continue
        if first is None:
            first = (path, content)
        changes: list[Difference] = differences(first[1], content)
        if changes:
            return f"seeds {_seed(first[0])} and {_seed(path)} differ in {', '.join(map(str, changes))}"
    return ""


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the grid and return the exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m src.status", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("study", help="results/<study>; a relative path lies in the repository")
    parser.add_argument("--json", action="store_true", help="print JSON: one object per row, its runs in it")
    options = parser.parse_args(arguments)
    try:
        grid = read_study(repository_path(options.study))
    except FileNotFoundError as error:
        print(error, file=sys.stderr)
        return ExitCode.REFUSED
    if options.json:
        print(json.dumps([as_json(row) for row in grid], indent=1))
    else:
        console = Console()
        show(grid, console if console.is_terminal else Console(width=140))  # a pipe has no width
    count = Counter(run.state for row in grid for run in row.runs)
    count[RunState.NOT_STARTED] += sum(len(row.missing) for row in grid)
    return ExitCode.FAILED if any(row.mixed for row in grid) else exit_code(count)


def show(grid: Sequence[Row], console: Console) -> None:
    """A row per configuration, its seeds by state; then why what failed has failed."""
    count = Counter(run.state for row in grid for run in row.runs)
    present = {state: "done" if state == RunState.COMPLETE else state.value for state in RunState if count[state]}
    missing = sum(len(row.missing) for row in grid)
    table = Table(box=None, pad_edge=False, header_style="bold")
    for column in ("algo", "env", "label", "encoder"):
        table.add_column(column, overflow="fold")
    for word in (*present.values(), *["missing"] * bool(missing)):
        table.add_column(word)
    for column in ("last eval.", "last 10 %", "steps", "steps/s", "time left"):
        table.add_column(column, justify="right", no_wrap=True)
    for row in grid:
        seeds = [ranges(row.seeds(state)) for state in present] + ([ranges(row.missing)] if missing else [])
        table.add_row(row.algo, row.env, row.label, row.encoder, *seeds, *_progress(row.runs))
    console.print(table)
    totals = [f"{count[state]} {word}" for state, word in present.items()]
    if missing:
        totals.append(f"{missing} missing")
    say(console, "runs: " + ", ".join(totals) + "  (the columns above list seeds)")
    say(
        console,
        "last eval.: mean return of each seed's newest evaluation; last 10 %: of the evaluations in the last 10 % of "
        "the steps, of complete runs; both are means over the seeds that have one",
    )
    for row in grid:
        for run in row.runs:
            if run.state in (RunState.FAILED, RunState.DIVERGED):
                say(console, f"{run.state}: {row.name}/seed_{run.seed}: {run.why}")
        if row.mixed:
            say(console, f"not one configuration: {row.name}: {row.mixed}")


def _progress(runs: Sequence[SeedStatus]) -> tuple[str, str, str, str, str]:
    """Mean of the newest and of the final returns, steps (the least), speed (the mean), time left (the longest)."""
    rate = _mean(run.steps_per_second for run in runs)
    left = [run.seconds_left for run in runs if run.state == RunState.RUNNING and run.seconds_left is not None]
    totals = sorted({run.total_steps for run in runs})
    lengths = thousands(totals[0]) if len(totals) == 1 else f"{thousands(totals[0])}..{thousands(totals[-1])}"
    return (
        number(_mean(run.last_return for run in runs)),
        number(_mean(run.final_return for run in runs)),
        f"{thousands(min(run.step for run in runs))}/{lengths}",
        "-" if rate is None else f"{rate:.0f}",
        duration(max(left)) if left else "-",
    )


def thousands(steps: int) -> str:
    """``500``, ``27.8k``, ``100k``, ``1M``: short enough for a narrow terminal."""
    for size, unit in ((1_000_000, "M"), (1_000, "k")):
        if steps >= size:
            return f"{steps / size:.3g}{unit}"
    return str(steps)


def ranges(seeds: Sequence[int]) -> str:
    """``0-3,7``."""
    parts: list[list[int]] = []
    for seed in seeds:
        if parts and seed == parts[-1][-1] + 1:
            parts[-1].append(seed)
        else:
            parts.append([seed])
    return ",".join(str(part[0]) if len(part) == 1 else f"{part[0]}-{part[-1]}" for part in parts)


def as_json(row: Row) -> dict[str, object]:
    """The row with its runs as plain objects."""
    runs = [run._asdict() | {"seconds_left": run.seconds_left} for run in row.runs]
    return row._asdict() | {"runs": runs, "missing": list(row.missing)}


if __name__ == "__main__":
    sys.exit(main())
