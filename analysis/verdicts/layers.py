"""The verdict rule, version 2, on the data of one family of claims under one algorithm.

1. Layer 1: one contrast a claim, pooled over tasks in normalised scores; Holm over the family.
2. Layer 2: the tasks of the claims that layer 1 decided; Holm over all of these rows.
3. Every task: twice the largest one-sided p over a claim's tasks; Holm over the family; needs layer 1.
4. Equal: two one-sided tests against the smallest relevant effect (``equality``); Holm over the family.

Before all planned seeds have finished, on all planned tasks where a study has such a plan, layer 1 alone is judged, at
``interim_alpha``: a verdict on the tasks that came first would be one more look.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from analysis.claims_file import Claims
from analysis.hypothesis_tests import (
    NOTHING,
    TEST_SEEDS,
    Contrast,
    holm,
    one_sided_p,
    welch_contrast,
)
from analysis.verdicts.equality import equality_p
from analysis.verdicts.results import Stage, Verdict
from analysis.verdicts.samples import Sample, TaskSample

_NAN = float("nan")


@dataclass(frozen=True)
class ClaimContrasts:
    """The contrasts of a claim: pooled, and by task in returns (NaN where the arms cannot be compared)."""

    sample: Sample
    pooled: Contrast
    rows: tuple[Contrast, ...]
    n: int

    def stage(self, claims: Claims) -> Stage:
        """Where the claim stands in its plan."""
        if self.n < TEST_SEEDS:
            return Stage.TOO_FEW
        tasks = self.sample.tasks if claims.tasks_planned else [task for task in self.sample.tasks if task.pooled]
        finished = all(len(arm) >= claims.planned_seeds for task in tasks for arm in task.arms)
        return Stage.FINAL if finished else Stage.INTERIM

    @property
    def every_task_p(self) -> float:
        """Twice the largest one-sided p over the tasks; NaN where one of them has no test."""
        return 2 * max(map(one_sided_p, self.rows)) if not any(np.isnan(row.p) for row in self.rows) else _NAN

    def equality_p(self, margin: float) -> float:
        """P of a pooled effect outside ± ``margin``."""
        covered = [task.normalised for task in self.sample.tasks if task.pooled]
        return equality_p(covered, self.sample.claim.weights, margin)


@dataclass(frozen=True)
class RowVerdict:
    """Layer 2 of one task; nothing where none is due."""

    verdict: Verdict | None = None
    adjusted_p: float = _NAN


@dataclass(frozen=True)
class ClaimVerdict:
    """All that the rule says of a claim."""

    tested: ClaimContrasts
    stage: Stage
    verdict: Verdict
    adjusted_p: float
    equal: bool | None
    equal_p: float
    every_task: Verdict | None
    every_task_p: float
    rows: tuple[RowVerdict, ...]


def contrasts_of(sample: Sample) -> ClaimContrasts:
    """Every contrast of a claim, each computed once."""
    covered = [task for task in sample.tasks if task.pooled]
    arms = [arm for task in covered for arm in task.normalised]
    weights = [weight / len(covered) for _ in covered for weight in sample.claim.weights]
    rows = tuple(_row(sample, task) for task in sample.tasks)
    return ClaimContrasts(sample, welch_contrast(arms, weights), rows, min(map(len, arms), default=0))


def _row(sample: Sample, task: TaskSample) -> Contrast:
    return welch_contrast(task.arms, sample.claim.weights) if task.comparable else NOTHING


def judge_family(tested: Sequence[ClaimContrasts], claims: Claims) -> list[ClaimVerdict]:
    """The rule for one family."""
    stages = [one.stage(claims) for one in tested]
    adjusted = holm([one.pooled.p for one in tested])
    verdicts = [
        layer_one(one.pooled, float(p), threshold(stage, claims), stage, one.n)
        for one, stage, p in zip(tested, stages, adjusted)
    ]
    rows = _layer_two(tested, stages, verdicts, claims)
    every_p = holm([one.every_task_p for one in tested])
    equal_p = holm([one.equality_p(claims.smallest_effect) for one in tested])
    judged = []
    for k, (one, stage, verdict) in enumerate(zip(tested, stages, verdicts)):
        final = stage is Stage.FINAL
        judged.append(
            ClaimVerdict(
                tested=one,
                stage=stage,
                verdict=verdict,
                adjusted_p=float(adjusted[k]),
                equal=bool(equal_p[k] < claims.alpha) if final else None,
                equal_p=float(equal_p[k]) if final else _NAN,
                every_task=on_every_task(verdict, float(every_p[k]), rows[k], claims.alpha) if final else None,
                every_task_p=float(every_p[k]) if final else _NAN,
                rows=rows[k],
            )
        )
    return judged


def threshold(stage: Stage, claims: Claims) -> float:
    """What an adjusted p of layer 1 must be below."""
    return claims.alpha if stage is Stage.FINAL else claims.interim_alpha


def layer_one(pooled: Contrast, adjusted_p: float, alpha: float, stage: Stage, n: int) -> Verdict:
    """The answer to a claim from its pooled contrast."""
    if n == 0:
        return Verdict.NOT_TESTABLE
    if stage is Stage.TOO_FEW:
        return Verdict.TOO_FEW_SEEDS
    return decided(adjusted_p, pooled.estimate, alpha)


def decided(adjusted_p: float, estimate: float, alpha: float) -> Verdict:
    """Supported or contradicted below ``alpha``, by the sign; else undecided; NaN: not testable."""
    if np.isnan(adjusted_p):
        return Verdict.NOT_TESTABLE
    if not adjusted_p < alpha:
        return Verdict.UNDECIDED
    return Verdict.SUPPORTED if estimate > 0 else Verdict.CONTRADICTED


def _layer_two(
    tested: Sequence[ClaimContrasts], stages: Sequence[Stage], verdicts: Sequence[Verdict], claims: Claims
) -> list[tuple[RowVerdict, ...]]:
    """Row verdicts of the claims that layer 1 decided on all planned seeds, Holm over all of their declared rows."""
    opened = [stage is Stage.FINAL and verdict.decided for stage, verdict in zip(stages, verdicts)]
    adjusted = iter(holm([row.p for one, is_open in zip(tested, opened) if is_open for row in one.rows]))
    found = []
    for one, is_open in zip(tested, opened):
        if not is_open:
            found.append(tuple(RowVerdict() for _ in one.rows))
            continue
        p_values = [float(next(adjusted)) for _ in one.rows]
        found.append(tuple(RowVerdict(decided(p, row.estimate, claims.alpha), p) for row, p in zip(one.rows, p_values)))
    return found


def on_every_task(verdict: Verdict, adjusted_p: float, rows: Sequence[RowVerdict], alpha: float) -> Verdict:
    """Supported if layer 1 is and the weakest task is; contradicted if any task is; not testable without every task."""
    if any(row.verdict is Verdict.CONTRADICTED for row in rows):
        return Verdict.CONTRADICTED
    if np.isnan(adjusted_p):
        return Verdict.NOT_TESTABLE
    return Verdict.SUPPORTED if verdict is Verdict.SUPPORTED and adjusted_p < alpha else Verdict.UNDECIDED
