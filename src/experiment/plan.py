"""The plan of a grid: every cell composed, validated and decided upon before anything starts. Never imports torch."""

from __future__ import annotations

import tempfile
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from rich.console import Console
from rich.table import Table

from src.config import ConfigurationError, ExperimentConfig, to_dict
from src.experiment.claim import refusal
from src.experiment.cost import cost
from src.experiment.decision import TO_DO, Action, Decision, decide
from src.experiment.hashing import flatten
from src.experiment.machine import ROOT
from src.experiment.progress import duration
from src.experiment.run_directory import RunDirectory

#: So many cells are named one by one; the rest is counted.
_NAMED = 10
_ORDER = list(Action)


class Cell(NamedTuple):
    """One cell, where its run lies and what will be done."""

    config: ExperimentConfig
    run: RunDirectory
    decision: Decision


class Plan(NamedTuple):
    """All cells of a grid, in the order of the grid."""

    cells: tuple[Cell, ...]

    @property
    def to_do(self) -> tuple[Cell, ...]:
        """The cells that start a job."""
        return tuple(cell for cell in self.cells if cell.decision.action in TO_DO)

    def having(self, action: Action) -> tuple[Cell, ...]:
        """The cells with this action."""
        return tuple(cell for cell in self.cells if cell.decision.action is action)


def make_plan(configs: Sequence[ExperimentConfig]) -> Plan:
    """Decide for every cell.

    Raises:
        ConfigurationError: two cells share a directory, or a directory holds another configuration's run.
    """
    _refuse_shared_directories(configs)
    cells = tuple(Cell(c, RunDirectory(RunDirectory.path_of(c)), decide(c)) for c in configs)
    plan = Plan(cells)
    if conflicts := plan.having(Action.CONFLICT):
        told = [refusal(cell.run.name, cell.decision) for cell in conflicts[:_NAMED]]
        if len(conflicts) > _NAMED:
            told.append(f"... and {len(conflicts) - _NAMED} more cells like these.")
        raise ConfigurationError("\n".join(told))
    return plan


def check_writable(config: ExperimentConfig) -> None:
    """Try to write where the results go.

    Raises:
        ConfigurationError: that can't be done.
    """
    folder = ROOT / config.results_dir
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass  # that it can be made is all we ask
    except OSError as error:
        raise ConfigurationError(
            f"results_dir: {config.results_dir} can't be written ({error.strerror}); choose another folder."
        ) from None


def show(plan: Plan, console: Console, jobs_at_once: int, with_cost: bool) -> None:
    """Print what will be done: a line per group of seeds, then the cells that need a word."""
    table = Table(box=None, pad_edge=False, header_style="bold")
    for column in ("algo", "env", "actor", "encoder"):
        table.add_column(column, overflow="fold")
    counts = {action: len(plan.having(action)) for action in _ORDER}
    present = [action for action in _ORDER if counts[action]]
    for action in present:
        table.add_column(action.value, justify="right")
    groups: dict[tuple[str, ...], Counter[Action]] = {}
    for cell in plan.cells:
        groups.setdefault(cell.run.path.parts[-5:-1], Counter())[cell.decision.action] += 1
    for names, actions in groups.items():
        table.add_row(*names, *(str(actions[action] or "") for action in present))
    studies = sorted({_shown(cell.run.path.parents[5]) for cell in plan.cells})
    done = counts[Action.SKIP] + counts[Action.DIVERGED]
    console.print(
        f"{len(plan.cells)} cell{'s' * (len(plan.cells) != 1)} in {', '.join(studies)}: "
        f"{len(plan.to_do)} to do, {done} done, {counts[Action.BUSY]} busy",
        highlight=False,
        soft_wrap=True,
    )
    if len(plan.cells) > 1:
        console.print(table)
    for action in (Action.RESUME, Action.RETRY, Action.EXTEND, Action.REPLACE, Action.DIVERGED, Action.BUSY):
        _name_cells(plan.having(action), console)
    if with_cost and plan.to_do:
        _show_cost(plan, console, jobs_at_once)


def _name_cells(cells: Sequence[Cell], console: Console) -> None:
    for cell in cells[:_NAMED]:
        line = f"{cell.decision.action}: {cell.run.name} ({cell.decision.reason})"
        console.print(line, highlight=False, markup=False, soft_wrap=True)
    if len(cells) > _NAMED:
        console.print(f"... and {len(cells) - _NAMED} more to {cells[0].decision.action}", highlight=False)


def _show_cost(plan: Plan, console: Console, jobs_at_once: int) -> None:
    fresh = {Action.RUN, Action.REPLACE}
    cells = [(c.config, 0 if c.decision.action in fresh else c.decision.step) for c in plan.to_do]
    estimate = cost(cells, jobs_at_once)
    basis = (
        "from the runs in the results folder" if estimate.measured else "rough: some rates are defaults, not measured"
    )
    console.print(
        f"about {duration(estimate.clock_hours * 3600)} with {jobs_at_once} at once, "
        f"{estimate.core_hours:.1f} core-hours ({basis})\n"
        f"about {_size(estimate.peak_bytes)} of disk for replay at the peak, "
        f"{_size(estimate.kept_bytes)} of it kept at the end",
        highlight=False,
        soft_wrap=True,
    )
    if estimate.unknown_sizes:
        console.print(
            f"not counted: the replay of {', '.join(estimate.unknown_sizes)} (sizes unknown)", highlight=False
        )


def _refuse_shared_directories(configs: Sequence[ExperimentConfig]) -> None:
    seen: dict[Path, ExperimentConfig] = {}
    for config in configs:
        path = RunDirectory.path_of(config)
        if path in seen:
            one, other = flatten(to_dict(seen[path])), flatten(to_dict(config))
            keys = sorted(key for key in one.keys() | other.keys() if one.get(key) != other.get(key))
            name = RunDirectory(path).name
            if not keys:
                raise ConfigurationError(f"{name}: the grid has this cell twice; name it once.")
            raise ConfigurationError(
                f"Two cells of the grid would share the directory {name}: they differ in {', '.join(keys)}. "
                f"Tell them apart with label=, such as 'label={config.actor.name}-${{{keys[0]}}}'."
            )
        seen[path] = config


def _shown(path: Path) -> str:
    return str(path.relative_to(ROOT)) if path.is_relative_to(ROOT) else str(path)


def _size(number: int) -> str:
    return f"{number / 1e9:.1f} GB" if number >= 1e9 else f"{number / 1e6:.0f} MB"
