"""The tables of claims with their verdicts: each claim (layer 1), and each claim on each task (layer 2)."""

from __future__ import annotations

import dataclasses
import math
from enum import Enum
from functools import partial
from typing import Any

import pandas as pd

from analysis.claims_file import Family
from analysis.coverage import covers
from analysis.data.confounds import MATCHED
from analysis.data.names import algorithm_name, task_name
from analysis.improvement import SEPARATED
from analysis.tables import Column, Table, number, p_value, pair, text
from analysis.verdicts import AlgorithmsResult, ClaimResult, Judgement, TaskResult, Verdict, wording


def claims_table(judgement: Judgement, title: str) -> Table:
    """One row per algorithm and claim, and one for all algorithms where there are several."""
    rows = [_over_algorithms(one) for one in judgement.over_algorithms]
    rows += [_claim(one, judgement) for one in judgement.results]
    frame = pd.DataFrame(rows, columns=list(_CLAIM))
    judged = not judgement.too_few_seeds
    alpha = judgement.rule.alpha
    columns: list[Column] = [
        ("algorithm", "Algorithm", text),
        ("text", "Claim", text),
        *_family(judgement),
        ("shown", "Effect, points [95%]", str),
        ("tasks", "Tasks", str),
        ("n", "n", number()),
    ]
    if judged:
        columns += [
            ("words", "Verdict", text),
            ("adjusted_p", "p (Holm)", partial(p_value, alpha=alpha)),
            ("every_task_words", "On every task", text),
        ]
    if any(one.claim.removes for one in judgement.results):
        columns.append(("removes", "Removes", text))
    columns += [
        ("seeds_needed", f"Seeds for {judgement.rule.smallest_effect:g} points", number()),
        ("remark", "Remark", text),
    ]
    caption = (
        "Effect: pooled over the tasks, in normalised points (100: the AAN reference), with its unadjusted 95% "
        f"interval. {covers('pooled')} n: the least number of seeds in an arm. Seeds: per arm, to detect the smallest "
        f"relevant effect with {judgement.rule.power:.0%} power at the spread seen."
    )
    if any(one.claim.removes for one in judgement.results):
        caption += " Removes: a confound that a control's arms do not have, as its claims file says."
    if any(one.confounds for one in judgement.results):
        caption += (
            " Confounded by: what goes with the actors and is not the same in the arms (numbers of parameters: by more "
            f"than {MATCHED:.0%})."
        )
    untested = [task for one in judgement.results for task in one.missing]
    if untested:
        caption += f" Not part of an effect: {wording.exclusions(untested)}."
    name, empty = "claims", "No runs, so no verdicts."
    paper = ("Algorithm", "Claim", "Effect, points [95%]", "n", "Verdict", "p (Holm)")
    return Table(name, "verdicts", title, caption, frame, columns, empty, paper=paper)


_CLAIM = (
    "algo", "name", "family", "stage", "n", "planned_seeds", "effect", "low", "high", "p", "df", "adjusted_p",
    "verdict", "equal", "equal_p", "every_task", "every_task_p", "seeds_needed", "covered", "missing",
    "removes", "confounds", "random_for_diverged", "without_diverged", "algorithm", "text", "words", "shown", "tasks",
    "every_task_words", "remark",
)  # fmt: skip


def _claim(one: ClaimResult, judgement: Judgement) -> dict[str, object]:
    planned = judgement.rule.planned_seeds
    return {
        "algo": one.algo,
        "name": one.claim.name,
        "family": one.claim.family,
        "stage": one.stage,
        "n": one.n,
        "planned_seeds": planned,
        "effect": one.pooled.estimate,
        "low": one.pooled.low,
        "high": one.pooled.high,
        "p": one.pooled.p,
        "df": one.pooled.df,
        "adjusted_p": one.adjusted_p,
        "verdict": one.verdict,
        "equal": one.equal,
        "equal_p": one.equal_p,
        "every_task": one.every_task,
        "every_task_p": one.every_task_p,
        "seeds_needed": one.seeds_needed,
        "covered": " ".join(one.covered),
        "missing": " ".join(task.env for task in one.missing),
        "random_for_diverged": one.diverged.random_score if one.diverged else None,
        "without_diverged": one.diverged.left_out if one.diverged else None,
        "algorithm": algorithm_name(one.algo),
        "text": one.claim.text,
        "words": wording.verdict_words(one),
        "shown": pair(one.pooled.estimate, one.pooled.low, one.pooled.high, 1),
        "tasks": wording.tasks_words(one),
        "every_task_words": one.every_task,
        "removes": ", ".join(one.claim.removes),
        "confounds": ", ".join(one.confounds),
        "remark": _joined(
            wording.stage_words(one, planned),
            wording.confound_words(one, values=True),
            wording.divergence_words([arm for task in one.tasks for arm in task.arms], one.diverged),
            wording.beyond_plan_words(one.tasks, planned),
            wording.own_reference_words(one.tasks),
        ),
    }


def _over_algorithms(one: AlgorithmsResult) -> dict[str, object]:
    return {
        "algo": " ".join(one.algos),
        "name": one.claim.name,
        "family": one.claim.family,
        "n": min(result.n for result in one.each),
        "adjusted_p": one.adjusted_p,
        "verdict": one.verdict,
        "every_task": one.every_task,
        "every_task_p": one.every_task_p,
        "algorithm": " and ".join(map(algorithm_name, one.algos)),
        "text": one.claim.text,
        "words": wording.verdict_words(one),
        "shown": "–",
        "tasks": "–",
        "every_task_words": one.every_task,
        "remark": "",
    }


def claims_by_task_table(judgement: Judgement) -> Table:
    """One row per algorithm, claim and task; printed are those with an estimate."""
    pairs = [(one, task) for one in judgement.results for task in one.tasks]
    frame = pd.DataFrame([_task(one, task) for one, task in pairs], columns=list(_TASK))
    measured = [not math.isnan(task.contrast.estimate) for _, task in pairs]
    judged = any(task.verdict for _, task in pairs)
    columns: list[Column] = [
        ("algorithm", "Algorithm", text),
        ("text", "Claim", text),
        *_family(judgement),
        ("task", "Task", text),
        ("shown", "Difference [95%]", str),
        ("normalised_shown", "In points [95%]", str),
        ("n", "n", str),
    ]
    if judged:
        columns += [
            ("verdict", "Verdict", text),
            ("adjusted_p", "p (Holm)", partial(p_value, alpha=judgement.rule.alpha)),
        ]
    columns += [
        ("effect", "Hedges' g", number(2)),
        ("improvement_shown", "P(improvement) [95%]", str),
        ("remark", "Remark", text),
    ]
    untested = [task for (_, task), shown in zip(pairs, measured) if not shown]
    hidden = f" {len(untested)} rows without an estimate stand in the CSV only." if untested else ""
    gate = "Verdicts and p: Holm over the rows of decided claims." if judged else (
        "No verdicts: no claim is decided on all its planned seeds."
    )  # fmt: skip
    caption = (
        f"Differences of final performance with Welch's interval. {covers('difference')} {gate} "
        "Intervals and Hedges' g are not adjusted for the number of rows. Synergy is the interaction (both − dendrites "
        "alone) − (lateral alone − neither); P(improvement) is not defined for it, elsewhere its interval is a "
        f"bootstrap's. {covers('improvement on one task')} {SEPARATED}{hidden}"
    )
    why = wording.exclusions(task for _, task in pairs)
    empty = f"None of these {len(pairs)} rows has an estimate: {why}." if pairs else "No runs, so no tests."
    shown = frame[measured] if pairs else None
    return Table(
        "claims_by_task", "statistics", "Every claim on every task", caption, frame, columns, empty, display=shown
    )


_TASK = (
    "algo", "claim", "family", "env", "verdict", "difference", "low", "high", "p", "adjusted_p", "df", "normalised",
    "normalised_low", "normalised_high", "effect", "improvement", "improvement_low", "improvement_high", "n",
    "beyond_plan", "diverged", "below_half", "bimodal", "random_for_diverged", "without_diverged", "reason",
    "algorithm", "text", "task", "shown", "normalised_shown", "improvement_shown", "remark",
)  # fmt: skip


def _task(one: ClaimResult, task: TaskResult) -> dict[str, object]:
    improvement = task.improvement
    better = (improvement.probability, improvement.low, improvement.high) if improvement else (math.nan,) * 3
    return {
        "algo": one.algo,
        "claim": one.claim.name,
        "family": one.claim.family,
        "env": task.env,
        "verdict": task.verdict,
        "difference": task.contrast.estimate,
        "low": task.contrast.low,
        "high": task.contrast.high,
        "p": task.contrast.p,
        "adjusted_p": task.adjusted_p,
        "df": task.contrast.df,
        "normalised": task.normalised.estimate,
        "normalised_low": task.normalised.low,
        "normalised_high": task.normalised.high,
        "effect": task.effect,
        "improvement": better[0],
        "improvement_low": better[1],
        "improvement_high": better[2],
        "n": " / ".join(str(arm.n) for arm in task.arms),
        "beyond_plan": " / ".join(str(arm.beyond_plan) for arm in task.arms),
        "diverged": " / ".join(str(arm.diverged) for arm in task.arms),
        "below_half": " / ".join(f"{arm.below_half:.3g}" for arm in task.arms),
        "bimodal": " ".join(arm.name for arm in task.arms if arm.bimodal),
        "random_for_diverged": task.diverged.random_score if task.diverged else None,
        "without_diverged": task.diverged.left_out if task.diverged else None,
        "reason": task.exclusion.reason if task.exclusion else None,
        "algorithm": algorithm_name(one.algo),
        "text": one.claim.text,
        "task": task_name(task.env),
        "shown": pair(task.contrast.estimate, task.contrast.low, task.contrast.high),
        "normalised_shown": pair(task.normalised.estimate, task.normalised.low, task.normalised.high, 1),
        "improvement_shown": pair(*better, 2),
        "remark": _joined(
            wording.exclusions([task]) if task.exclusion and one.verdict is not Verdict.TOO_FEW_SEEDS else "",
            wording.bimodality_words(task),
            wording.divergence_words(task.arms, task.diverged),
        ),
    }


def _family(judgement: Judgement) -> list[Column]:
    """A column that tells families apart, where there are several."""
    families = {one.claim.family for one in judgement.results}
    return [("family", "Source", lambda family: wording.FAMILIES[Family(family)])] if len(families) > 1 else []


def _joined(*parts: str) -> str:
    return "; ".join(filter(None, parts))


def plain(value: Any) -> Any:
    """A judgement as JSON: dataclasses as objects, NaN as null."""
    if dataclasses.is_dataclass(value) or hasattr(value, "_asdict"):
        names = value._fields if hasattr(value, "_asdict") else [field.name for field in dataclasses.fields(value)]
        return {name: plain(getattr(value, name)) for name in names}
    if isinstance(value, dict):
        return {name: plain(item) for name, item in value.items()}
    if isinstance(value, tuple):
        return [plain(item) for item in value]
    if isinstance(value, Enum):
        return value.value
    return None if isinstance(value, float) and math.isnan(value) else value
