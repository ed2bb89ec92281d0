"""The grid of a study as a table: ``python -m src.status results/paper``. Reads files only, never torch.

Exit codes: 0 every run there is has ended well (complete or diverged) and no seed is missing, 1 a run failed,
75 something is running, interrupted or missing, 2 there is no such study.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.table import Table

from src.experiment.machine import ROOT
from src.experiment.outcome import DONE, FAILED, INTERRUPTED, REFUSED
from src.experiment.progress import duration, number
from src.experiment.study import Row, RunState, count, rows

STATES = ("complete", "running", "interrupted", "failed", "diverged")


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the grid and return the exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m src.status", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("study", type=Path, help="results/<study>")
    parser.add_argument("--json", action="store_true", help="print JSON: one object per row, its runs in it")
    options = parser.parse_args(arguments)
    study = options.study if options.study.exists() else ROOT / options.study
    try:
        grid = rows(study if study.exists() else options.study)
    except FileNotFoundError as error:
        print(error, file=sys.stderr)
        return REFUSED
    if options.json:
        print(json.dumps([as_json(row) for row in grid], indent=1))
    else:
        console = Console()
        show(grid, console if console.is_terminal else Console(width=140))  # a pipe has no width
    if count(grid, "failed"):
        return FAILED
    unfinished = count(grid, "running", "interrupted") + sum(len(row.missing) for row in grid)
    return INTERRUPTED if unfinished else DONE


def show(grid: Sequence[Row], console: Console) -> None:
    """A row per cell, its seeds by state; then why what failed has failed."""
    present = [state for state in STATES if count(grid, state)]
    missing = any(row.missing for row in grid)
    table = Table(box=None, pad_edge=False, header_style="bold")
    for column in ("algo", "env", "label", "encoder"):
        table.add_column(column, overflow="fold")
    for state in present:
        table.add_column("done" if state == "complete" else state)
    if missing:
        table.add_column("missing")
    for column in ("return", "steps", "steps/s", "time left"):
        table.add_column(column, justify="right", no_wrap=True)
    for row in grid:
        seeds = [ranges(row.seeds(state)) for state in present] + ([ranges(row.missing)] if missing else [])
        table.add_row(row.algo, row.env, row.label, row.encoder, *seeds, *_progress(row.runs))
    console.print(table)
    totals = [f"{count(grid, state)} {'done' if state == 'complete' else state}" for state in present]
    if missing:
        totals.append(f"{sum(len(row.missing) for row in grid)} missing")
    console.print("runs: " + ", ".join(totals) + "  (the columns above list seeds)", highlight=False)
    for row in grid:
        for run in row.runs:
            if run.state in ("failed", "diverged"):
                name = f"{row.algo}/{row.env}/{row.label}/{row.encoder}/seed_{run.seed}"
                console.print(f"{run.state}: {name}: {run.why}", highlight=False, markup=False, soft_wrap=True)


def _progress(runs: Sequence[RunState]) -> tuple[str, str, str, str]:
    """Mean last return, steps (the least), speed (the mean) and time left (the longest) of a row."""
    returns = [run.last_return for run in runs if run.last_return is not None]
    rates = [run.steps_per_second for run in runs if run.steps_per_second]
    left = [run.seconds_left for run in runs if run.state == "running" and run.seconds_left is not None]
    behind = min(runs, key=lambda run: run.step)
    return (
        number(sum(returns) / len(returns) if returns else None),
        f"{thousands(behind.step)}/{thousands(behind.total_steps)}",
        f"{sum(rates) / len(rates):.0f}" if rates else "-",
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
