"""The rows of the forest plot: what the first screen says of each claim and of its tasks."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any

from analysis.data.names import actor_name, task_name
from analysis.tables import pair
from analysis.verdicts import ClaimResult, Judgement, TaskResult, Verdict
from analysis.verdicts.wording import confound_words, removes_words, stage_words, verdict_words


@dataclass(frozen=True)
class ForestRow:
    """A claim (``pooled``) or one of its tasks; ``estimate``, ``low``, ``high`` in normalised points, NaN if unknown.

    ``effect``: the same in words. ``verdict``: empty where none is due. ``remark``: why there is no effect, or what
    tempers it. ``control``: which confound the claim removes.
    """

    pooled: bool
    claim: str
    family: str
    label: str
    n: str
    estimate: float
    low: float
    high: float
    effect: str
    verdict: str
    tone: str
    remark: str
    control: str = ""

    def record(self) -> dict[str, Any]:
        """For the CSV of the figure."""
        return asdict(self)


def rows_of(judgement: Judgement, algo: str) -> list[ForestRow]:
    """Every claim under an algorithm, each followed by its tasks; families in order."""
    rows = []
    for result in judgement.results:
        if result.algo == algo:
            rows.append(_claim(result, judgement))
            rows += [_task(result, task) for task in result.tasks if task.covered or _has_runs(task)]
    return rows


def _has_runs(task: TaskResult) -> bool:
    return task.contrast.estimate == task.contrast.estimate


def _claim(result: ClaimResult, judgement: Judgement) -> ForestRow:
    contrast, tasks = result.pooled, [task_name(env) for env in result.covered]
    every = len(result.tasks)
    over = f"{len(tasks)} of {every} tasks" if len(tasks) < every else f"{every} task{'s' * (every != 1)}"
    remark = f"over {over}" if tasks else "no task with comparable finished runs"
    if stage := stage_words(result, judgement.rule.planned_seeds):
        remark += f"; {stage}"
    if result.every_task is not None and every > 1:
        remark += f"; on every task: {result.every_task}"
    remark = "; ".join(filter(None, (remark, confound_words(result))))
    verdict = "" if judgement.too_few_seeds else verdict_words(result)
    return ForestRow(
        True, result.claim.name, str(result.claim.family), result.claim.text, f"n={result.n}", contrast.estimate,
        contrast.low, contrast.high, pair(contrast.estimate, contrast.low, contrast.high, 1), verdict,
        _tone(result.verdict), remark, removes_words(result.claim),
    )  # fmt: skip


def _task(result: ClaimResult, task: TaskResult) -> ForestRow:
    contrast = task.normalised
    n = "n=" + (
        "/".join(str(arm.n) for arm in task.arms) if len({arm.n for arm in task.arms}) > 1 else str(task.arms[0].n)
    )
    returns = f"{pair(task.contrast.estimate, task.contrast.low, task.contrast.high)} in returns"
    remark = returns + ("" if task.covered else f"; not pooled: {task.exclusion.reason}" if task.exclusion else "")
    if task.scale is not None and task.scale.own:
        remark += "; 100 is this study's own AAN"
    if bimodal := [actor_name(arm.name) for arm in task.arms if arm.bimodal]:
        remark += f"; two groups of seeds in {', '.join(bimodal)}: the mean misleads"
    verdict = "" if task.verdict is None else str(task.verdict)
    return ForestRow(
        False, result.claim.name, str(result.claim.family), task_name(task.env), n, contrast.estimate, contrast.low,
        contrast.high, pair(contrast.estimate, contrast.low, contrast.high, 1), verdict, _tone(task.verdict), remark,
    )  # fmt: skip


def _tone(verdict: Verdict | None) -> str:
    return {Verdict.SUPPORTED: "good", Verdict.CONTRADICTED: "bad"}.get(verdict, "plain") if verdict else "plain"


def limits(rows: list[ForestRow], band: float) -> tuple[float, float]:
    """The ends of the axis: all pooled intervals, all estimates and the band; wider intervals of tasks are cut."""
    ends = [-1.4 * band, 1.4 * band]
    for row in rows:
        ends += [row.estimate] + ([row.low, row.high] if row.pooled else [])
    known = [end for end in ends if not math.isnan(end)]
    margin = 0.05 * (max(known) - min(known))
    return min(known) - margin, max(known) + margin
