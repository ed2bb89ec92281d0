"""The plan of a grid: what will be done with every run, decided before anything starts. Never imports torch."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from src.config import ENGINE, ConfigurationError, to_dict
from src.config.identity import Run, differences, flatten, hashed_values
from src.experiment.checks import check_devices, check_installed
from src.experiment.ownership import conflict_message
from src.experiment.run_directory import ManifestError, RunDirectory
from src.experiment.state import TO_DO, Next, NextAction, next_action

#: So many runs are named one by one; the rest is counted.
NAMED = 10


class PlannedRun(NamedTuple):
    """One run, its directory and what will be done."""

    run: Run
    directory: RunDirectory
    next: NextAction

    @property
    def name(self) -> str:
        """``td3/hopper/bptsan/poisson/seed_2``."""
        return self.run.name


class Plan(NamedTuple):
    """All runs of a grid, in the order of the grid."""

    runs: tuple[PlannedRun, ...]

    @property
    def to_do(self) -> tuple[PlannedRun, ...]:
        """The runs that start a job."""
        return tuple(each for each in self.runs if each.next.action in TO_DO)

    def having(self, action: Next) -> tuple[PlannedRun, ...]:
        """The runs with this action."""
        return tuple(each for each in self.runs if each.next.action is action)


def make_plan(runs: Sequence[Run], gpus_here: bool = False) -> Plan:
    """Decide for every run.

    Args:
        runs: the grid.
        gpus_here: the runs will train on this machine, whose GPUs can be counted.

    Raises:
        ConfigurationError: what can't be run here; two runs share a directory, or a directory holds another
            configuration's run; the seeds of one label differ in more than their seed.
    """
    check_installed(run.config for run in runs)
    if gpus_here:
        check_devices(run.config for run in runs)
    _refuse_shared_directories(runs)
    plan = Plan(tuple(PlannedRun(run, RunDirectory(run.path), next_action(run)) for run in runs))
    _refuse([conflict_message(each.run, each.next) for each in plan.having(Next.CONFLICT)])
    _refuse(list(_mixed_seeds(runs)))
    return plan


def _refuse(mistakes: Sequence[str]) -> None:
    if mistakes:
        more = [f"... and {len(mistakes) - NAMED} more runs like these."] if len(mistakes) > NAMED else []
        raise ConfigurationError("\n".join([*mistakes[:NAMED], *more]))


def _refuse_shared_directories(runs: Sequence[Run]) -> None:
    seen: dict[Path, Run] = {}
    for run in runs:
        if run.path not in seen:
            seen[run.path] = run
            continue
        other = seen[run.path]
        keys = [each.key for each in differences(flatten(to_dict(other.config)), flatten(to_dict(run.config)))]
        if not keys:
            raise ConfigurationError(f"{run.name}: the grid has this run twice; name it once.")
        raise ConfigurationError(
            f"Two runs of the grid would share the directory {run.name}: they differ in {', '.join(keys)}. "
            f"Tell them apart with label=, such as 'label={run.config.actor.name}-${{{keys[0]}}}'."
        )


def _mixed_seeds(runs: Sequence[Run]) -> Iterator[str]:
    """The seeds of one label must be one configuration, those of this grid and those that lie beside them."""
    planned = {run.path for run in runs}
    first: dict[Path, Run] = {}
    for run in runs:
        own = compared_between_seeds(to_dict(run.config), ENGINE)
        folder = run.path.parent
        if folder in first:
            other = first[folder]
            yield from _mixed(
                run, own, f"seed {other.config.seed}", compared_between_seeds(to_dict(other.config), ENGINE)
            )
            continue
        first[folder] = run
        for sibling in sorted(folder.glob("seed_*")):
            if sibling not in planned and (there := compared_on_disk(sibling)) is not None:
                yield from _mixed(run, own, f"{sibling.name.replace('_', ' ')}, which is there already", there)


def _mixed(run: Run, own: dict[str, Any], other: str, others: dict[str, Any]) -> Iterator[str]:
    if changes := differences(others, own):
        yield (
            f"{run.name} and {other}: they differ in more than the seed: {', '.join(map(str, changes))}. "
            "One label is one configuration: choose another place (study=..., or label=... for a variant), "
            "or ask for all its seeds alike."
        )


def compared_between_seeds(content: dict[str, Any], engine: int) -> dict[str, Any]:
    """What all seeds of one label have in common: all that changes numbers, and how long they train."""
    return hashed_values(content) | {
        "seed": None,
        "protocol.total_steps": content["protocol"]["total_steps"],
        "engine": engine,
    }


def compared_on_disk(path: Path) -> dict[str, Any] | None:
    """The same of a run directory; None where it holds no run that can be read."""
    directory = RunDirectory(path)
    try:
        manifest = directory.read_manifest()
    except ManifestError:
        return None
    content = directory.read_config()
    if manifest is None or content is None:
        return None
    try:
        return compared_between_seeds(content, manifest.engine) | {"protocol.total_steps": manifest.total_steps}
    except (KeyError, TypeError):
        return None
