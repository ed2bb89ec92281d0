"""From a study to its :class:`~analysis.verdicts.results.Judgement`."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from analysis.claims_file import Claims, Family, Kind
from analysis.data.cells import Cell
from analysis.data.names import ordered_algorithms
from analysis.data.study import Study
from analysis.failure_rates import failures
from analysis.hypothesis_tests import NOTHING, TEST_SEEDS, Contrast, holm, one_sided_p, seeds_for_effect, spread_within
from analysis.improvement import improvement_with_interval
from analysis.metrics import hedges_g
from analysis.verdicts.bimodality import bimodal, share_below_half
from analysis.verdicts.layers import (
    ClaimVerdict,
    RowVerdict,
    contrasts_of,
    decided,
    judge_family,
    threshold,
)
from analysis.verdicts.results import (
    AlgorithmsResult,
    ArmSummary,
    ClaimResult,
    Exclusion,
    Improvement,
    Judgement,
    Reason,
    Stage,
    TaskResult,
    Verdict,
    WithoutDivergence,
)
from analysis.verdicts.samples import Sample, TaskSample, samples_of

_NAN = float("nan")


def judge(study: Study, cells: list[Cell], claims: Claims) -> Judgement:
    """Every claim, under each algorithm of the study and, where there are several, under all of them."""
    algos = ordered_algorithms({cell.algo for cell in cells})
    results: list[ClaimResult] = []
    for algo in algos:
        samples = samples_of(study, cells, claims, algo)
        for family in Family:
            results += _family([sample for sample in samples if sample.claim.family is family], claims)
    return Judgement(claims, tuple(results), _over_algorithms(results, algos, claims))


def _family(samples: list[Sample], claims: Claims) -> list[ClaimResult]:
    judged = judge_family([contrasts_of(sample) for sample in samples], claims)
    if not any(sample.any_diverged for sample in samples):
        return [_result(one, None, None, len(samples), claims) for one in judged]
    random = judge_family([contrasts_of(sample.with_random_score(claims)) for sample in samples], claims)
    left_out = judge_family([contrasts_of(sample.without_diverged()) for sample in samples], claims)
    return [_result(*three, len(samples), claims) for three in zip(judged, random, left_out)]


def _result(
    judged: ClaimVerdict, random: ClaimVerdict | None, left_out: ClaimVerdict | None, family_size: int, claims: Claims
) -> ClaimResult:
    sample = judged.tested.sample
    covered = [task for task in sample.tasks if task.pooled]
    weights = [weight / len(covered) for _ in covered for weight in sample.claim.weights]
    spread = spread_within([arm for task in covered for arm in task.normalised])
    diverged = None
    if random and left_out and sample.any_diverged:
        diverged = WithoutDivergence(random.verdict, left_out.verdict)
    return ClaimResult(
        algo=sample.algo,
        claim=sample.claim,
        stage=judged.stage,
        n=judged.tested.n,
        pooled=judged.tested.pooled,
        adjusted_p=judged.adjusted_p,
        verdict=judged.verdict,
        equal=judged.equal,
        equal_p=judged.equal_p,
        every_task=judged.every_task,
        every_task_p=judged.every_task_p,
        seeds_needed=seeds_for_effect(claims.smallest_effect, spread, weights, claims.alpha / family_size, claims.power)
        if covered
        else None,
        diverged=diverged,
        tasks=tuple(
            _task(
                sample,
                task,
                judged.tested.rows[k],
                judged.rows[k],
                (random.rows[k], left_out.rows[k]) if random and left_out else None,
                claims,
            )
            for k, task in enumerate(sample.tasks)
        ),
    )


def _task(
    sample: Sample,
    task: TaskSample,
    contrast: Contrast,
    row: RowVerdict,
    again: tuple[RowVerdict, RowVerdict] | None,
    claims: Claims,
) -> TaskResult:
    scores = task.normalised
    arms = tuple(
        ArmSummary(
            name=name,
            n=len(values),
            beyond_plan=task.beyond_plan[k],
            diverged=int(task.diverged[k].sum()),
            below_half=share_below_half(scores[k]) if scores else _NAN,
            failed=failures(scores[k], claims.failure_score) if scores else 0,
            bimodal=bool(scores) and bimodal(scores[k], claims.smallest_effect),
        )
        for k, (name, values) in enumerate(zip(sample.claim.arms, task.arms))
    )
    effect, improvement = _NAN, None
    if sample.claim.kind is Kind.DIFFERENCE and task.comparable and all(map(len, task.arms)):
        first, second = task.arms
        effect = hedges_g(first, second)
        improvement = Improvement(*improvement_with_interval([first], [second]))
    diverged = None
    if again and row.verdict is not None and any(mask.any() for mask in task.diverged):
        diverged = WithoutDivergence(again[0].verdict, again[1].verdict)
    return TaskResult(
        env=task.env,
        arms=arms,
        scale=task.scale,
        contrast=contrast,
        normalised=contrast.scaled(task.scale.points) if task.scale and task.pooled else NOTHING,
        exclusion=task.exclusion or _no_test(sample, task, contrast),
        verdict=row.verdict,
        adjusted_p=row.adjusted_p,
        effect=effect,
        improvement=improvement,
        diverged=diverged,
        confounds=task.confounds,
    )


def _no_test(sample: Sample, task: TaskSample, contrast: Contrast) -> Exclusion | None:
    if few := tuple(name for name, values in zip(sample.claim.arms, task.arms) if len(values) < TEST_SEEDS):
        return Exclusion(Reason.TOO_FEW_SEEDS, few)
    return Exclusion(Reason.NO_VARIANCE, sample.claim.arms) if np.isnan(contrast.p) else None


def _over_algorithms(results: Sequence[ClaimResult], algos: list[str], claims: Claims) -> tuple[AlgorithmsResult, ...]:
    """Each claim that stands under every algorithm, by the rule for tasks."""
    if len(algos) < 2:
        return ()
    found: list[AlgorithmsResult] = []
    for family in Family:
        names = dict.fromkeys(result.claim.name for result in results if result.claim.family is family)
        groups = [tuple(r for r in results if r.claim.family is family and r.claim.name == name) for name in names]
        groups = [group for group in groups if len(group) == len(algos)]
        pooled_p = holm([_weakest([result.pooled for result in group]) for group in groups])
        rows_p = holm([_weakest([task.contrast for result in group for task in result.tasks]) for group in groups])
        found += [
            _all_algorithms(group, float(p), float(q), tuple(algos), claims)
            for group, p, q in zip(groups, pooled_p, rows_p)
        ]
    return tuple(found)


def _weakest(contrasts: Sequence[Contrast]) -> float:
    """Twice the largest one-sided p; NaN where one of them has no test."""
    p_values = [one_sided_p(contrast) for contrast in contrasts]
    return _NAN if np.isnan(p_values).any() else min(1.0, 2 * max(p_values))


def _all_algorithms(
    group: tuple[ClaimResult, ...], pooled_p: float, rows_p: float, algos: tuple[str, ...], claims: Claims
) -> AlgorithmsResult:
    stages = [result.stage for result in group]
    stage = next((stage for stage in (Stage.TOO_FEW, Stage.INTERIM) if stage in stages), Stage.FINAL)
    verdict = _of_all([result.verdict for result in group], decided(pooled_p, 1.0, threshold(stage, claims)))
    every_task = None
    if stage is Stage.FINAL:
        every = decided(rows_p, 1.0, claims.alpha) if verdict is Verdict.SUPPORTED else Verdict.UNDECIDED
        every_task = _of_all([result.every_task for result in group], every)
    return AlgorithmsResult(algos, group[0].claim, verdict, pooled_p, every_task, rows_p, group)


def _of_all(each: Sequence[Verdict | None], otherwise: Verdict) -> Verdict:
    """One contradiction contradicts, one that cannot be judged leaves all open; else what the weakest p says."""
    for kind in (Verdict.CONTRADICTED, Verdict.TOO_FEW_SEEDS, Verdict.NOT_TESTABLE):
        if kind in each:
            return kind
    return otherwise
