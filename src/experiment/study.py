"""What a study holds, read from its files: every run, and the grid as rows."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from src.experiment.csv_log import last_return, last_row
from src.experiment.lock import alive_elsewhere, held_here
from src.experiment.manifest import ManifestError, read


class RunState(NamedTuple):
    """One run. ``state`` is the manifest's status, but ``running`` only where a process is alive."""

    seed: int
    state: str
    step: int
    total_steps: int
    last_return: float | None
    steps_per_second: float | None  # of the last interval; of a complete run over all
    why: str

    @property
    def seconds_left(self) -> float | None:
        """At the speed of the last interval; None where that isn't known."""
        if self.state == "complete":
            return 0.0
        return (self.total_steps - self.step) / self.steps_per_second if self.steps_per_second else None


class Row(NamedTuple):
    """All seeds of one cell."""

    algo: str
    env: str
    label: str
    encoder: str
    runs: tuple[RunState, ...]
    missing: tuple[int, ...]  # seeds that other rows of the study have

    def seeds(self, *states: str) -> tuple[int, ...]:
        """Seeds of the runs in one of these states."""
        return tuple(run.seed for run in self.runs if run.state in states)


def rows(study: Path) -> list[Row]:
    """The grid of ``results/<study>``, in alphabetical order.

    Raises:
        FileNotFoundError: there is no such study, or nothing in it.
    """
    if not study.is_dir():
        raise FileNotFoundError(f"{study}: there is no such study; results/<study> is made by the first run.")
    cells: dict[tuple[str, ...], list[RunState]] = {}
    for path in sorted((study / "runs").glob("*/*/*/*/seed_*")):
        if (path / "manifest.json").exists() or (path / "state").is_dir():
            cells.setdefault(path.parts[-5:-1], []).append(state_of(path))
    if not cells:
        raise FileNotFoundError(f"{study}: there are no runs in it yet.")
    seeds = {run.seed for runs in cells.values() for run in runs}
    return [
        Row(algo, env, label, encoder, tuple(sorted(runs)), tuple(sorted(seeds - {run.seed for run in runs})))
        for (algo, env, label, encoder), runs in cells.items()
    ]


def state_of(path: Path) -> RunState:
    """One run directory, read while it may be written."""
    seed = int(path.name.removeprefix("seed_"))
    try:
        manifest = read(path / "manifest.json")
    except ManifestError as error:
        return RunState(seed, "failed", 0, 0, None, None, str(error))
    if manifest is None:
        state = "running" if held_here(path) else "interrupted"
        return RunState(seed, state, 0, 0, None, None, "not begun")
    state, why = manifest.status, manifest.failure.message if manifest.failure else ""
    if state == "running" and not held_here(path) and not alive_elsewhere(path, manifest):
        state, why = "interrupted", "its process is gone"
    row = last_row(path / "training.csv")
    rate = float(row.get("steps_per_second") or 0) if row else 0.0
    if state == "complete" and manifest.wall_time_seconds > 0:
        rate = manifest.step / manifest.wall_time_seconds
    returns = last_return(path / "evaluations.csv")
    return RunState(seed, state, manifest.step, manifest.total_steps, returns, rate or None, why)


def count(grid: Sequence[Row], *states: str) -> int:
    """Runs in one of these states."""
    return sum(len(row.seeds(*states)) for row in grid)
