"""The data of a claim: its arms on each task, or why they cannot be compared there."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from analysis.claims_file import Claim, Claims, Family, Kind
from analysis.data.cells import Cell, select
from analysis.data.confounds import Confound, confounds, confounds_of_actors
from analysis.data.names import actor_name, ordered_arms, ordered_tasks
from analysis.data.study import Study
from analysis.references import Scale, random_return, scale
from analysis.verdicts.results import Exclusion, Reason

Array = NDArray[np.float64]


@dataclass(frozen=True)
class TaskSample:
    """Final performance of each arm, in returns, ``[seeds]`` each, and which of these runs diverged.

    ``exclusion``: why the arms cannot be compared, or have no normalised score; few seeds are no exclusion here.
    """

    env: str
    arms: tuple[Array, ...]
    diverged: tuple[NDArray[np.bool_], ...]
    beyond_plan: tuple[int, ...]
    scale: Scale | None
    exclusion: Exclusion | None
    confounds: tuple[Confound, ...] = ()

    @property
    def comparable(self) -> bool:
        """Whether the difference between the arms means anything."""
        return self.exclusion is None or self.exclusion.reason is Reason.NO_REFERENCE_SCORE

    @property
    def pooled(self) -> bool:
        """Whether the task is part of the pooled effect."""
        return self.exclusion is None and all(len(arm) for arm in self.arms)

    @property
    def normalised(self) -> tuple[Array, ...]:
        """The arms in normalised points; none without a scale."""
        return tuple(self.scale.normalised(arm) for arm in self.arms) if self.scale else ()


@dataclass(frozen=True)
class Sample:
    """A claim under one algorithm with its data."""

    algo: str
    claim: Claim
    tasks: tuple[TaskSample, ...]

    @property
    def any_diverged(self) -> bool:
        """Whether a run of the claim diverged."""
        return any(mask.any() for task in self.tasks for mask in task.diverged)

    def without_diverged(self) -> Sample:
        """The same without the runs that diverged."""
        tasks = (
            replace(task, arms=tuple(arm[~mask] for arm, mask in zip(task.arms, task.diverged))) for task in self.tasks
        )
        return replace(self, tasks=tuple(tasks))

    def with_random_score(self, claims: Claims) -> Sample:
        """The same with a random policy's return for the runs that diverged, where it is known."""
        return replace(self, tasks=tuple(_random_for_diverged(task, claims) for task in self.tasks))


def _random_for_diverged(task: TaskSample, claims: Claims) -> TaskSample:
    zero = random_return(task.env, claims)
    if zero is None:
        return task
    return replace(task, arms=tuple(np.where(mask, zero, arm) for arm, mask in zip(task.arms, task.diverged)))


def samples_of(study: Study, cells: list[Cell], claims: Claims, algo: str) -> list[Sample]:
    """Declared and user's claims in the order of the file, then the automatic ones."""
    every = [*claims.claims, *automatic_claims(cells, claims, algo)]
    return [
        Sample(algo, claim, tuple(_task(study, cells, claims, claim, algo, env) for env in claim.tasks))
        for claim in every
    ]


def automatic_claims(cells: list[Cell], claims: Claims, algo: str) -> list[Claim]:
    """One for each label that no claim names, against each baseline that is present, on all tasks of the study."""
    here = select(cells, algo)
    named = {arm for claim in claims.claims for arm in claim.arms}
    present = ordered_arms({cell.arm for cell in here})
    tasks = tuple(ordered_tasks({cell.env for cell in here}))
    return [
        Claim(
            name=f"{arm}_over_{baseline}",
            text=f"{actor_name(arm)} beats {actor_name(baseline)}",
            kind=Kind.DIFFERENCE,
            family=Family.EXPLORATORY,
            arms=(arm, baseline),
            weights=(1.0, -1.0),
            tasks=tasks,
        )
        for arm in present
        if arm not in named and arm not in claims.baselines
        for baseline in claims.baselines
        if baseline in present
    ]


def _task(study: Study, cells: list[Cell], claims: Claims, claim: Claim, algo: str, env: str) -> TaskSample:
    found = [_cell(cells, claim, algo, env, arm) for arm in claim.arms]
    kept = [_in_plan(cell, claims.planned_seeds) for cell in found]
    arms = tuple(cell.final[mask] if cell else np.array([]) for cell, mask in zip(found, kept))
    of_task = scale(cells, algo, env, claims)
    return TaskSample(
        env=env,
        arms=arms,
        diverged=tuple(c.diverged[mask] if c else np.array([], dtype=bool) for c, mask in zip(found, kept)),
        beyond_plan=tuple(int((c.seeds >= claims.planned_seeds).sum()) if c else 0 for c in found),
        scale=of_task,
        exclusion=_exclusion(study, cells, claim, algo, env, arms, of_task),
        confounds=confounds_of_actors(study, algo, env, claim.arms) if all(map(len, arms)) else (),
    )


def _cell(cells: list[Cell], claim: Claim, algo: str, env: str, arm: str) -> Cell | None:
    """The arm's cell; for a declared claim only if it is the paper's actor, unchanged."""
    found = select(cells, algo, env, arm)
    return found[0] if found and (found[0].paper or claim.family is not Family.DECLARED) else None


def _in_plan(cell: Cell | None, planned: int) -> NDArray[np.bool_]:
    """Which seeds decide: those of the plan, 0 to ``planned - 1``, that have a final performance."""
    if cell is None:
        return np.array([], dtype=bool)
    return np.asarray((cell.seeds < planned) & ~np.isnan(cell.final))


def _exclusion(
    study: Study, cells: list[Cell], claim: Claim, algo: str, env: str, arms: tuple[Array, ...], of_task: Scale | None
) -> Exclusion | None:
    if not select(cells, algo, env):
        return Exclusion(Reason.NO_RUNS, claim.arms)
    if lacking := tuple(name for name, values in zip(claim.arms, arms) if not len(values)):
        return Exclusion(Reason.NO_FINISHED_RUN, lacking)
    if differing := confounds(study, algo, env, claim.arms):
        return Exclusion(Reason.UNEQUAL_SETTINGS, claim.arms, tuple(differing))
    return None if of_task else Exclusion(Reason.NO_REFERENCE_SCORE, claim.arms)
