"""Sentences about verdicts: each fact has its words here, once."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from analysis.claims_file import Claim, Family
from analysis.data.names import actor_name, algorithm_name, ordered_arms, ordered_tasks, task_name
from analysis.hypothesis_tests import TEST_SEEDS, detectable_effect
from analysis.verdicts.results import (
    AlgorithmsResult,
    ArmSummary,
    ClaimResult,
    Judgement,
    Reason,
    Stage,
    TaskResult,
    Verdict,
    WithoutDivergence,
)

#: In the order in which they are named; ``{arms}`` and ``{tasks}`` are lists of names.
REASONS = {
    Reason.NO_RUNS: "no runs on {tasks}",
    Reason.NO_FINISHED_RUN: "no finished run of {arms} on {tasks}",
    Reason.UNEQUAL_SETTINGS: "{arms} trained under different settings on {tasks}",
    Reason.NO_REFERENCE_SCORE: "no score of a random policy, or none of an AAN, on {tasks}",
    Reason.TOO_FEW_SEEDS: "too few finished seeds of {arms} on {tasks}",
    Reason.NO_VARIANCE: "no variance between the seeds of {arms} on {tasks}",
}
#: More claims of one verdict that decides nothing are not named in the headline.
MOST_CLAIMS = 5
FAMILIES = {
    Family.DECLARED: "declared",
    Family.USER: "yours",
    Family.EXPLORATORY: "exploratory",
}


def verdict_words(result: ClaimResult | AlgorithmsResult) -> str:
    """``supported, smaller than relevant``, ``no relevant difference``, ``undecided``."""
    words = str(result.verdict)
    if isinstance(result, AlgorithmsResult):
        return words
    if result.equal:
        words = f"{words}, smaller than relevant" if result.verdict.decided else "no relevant difference"
    return words


def stage_words(result: ClaimResult, planned: int) -> str:
    """``interim, 6 of 10 seeds``, ``interim, 1 of 2 planned tasks``; empty before the first look and after the plan."""
    if result.stage is not Stage.INTERIM:
        return ""
    of_plan = f"{result.n} of {planned} seeds" if result.n < planned else f"{tasks_words(result)} planned tasks"
    return f"interim, {of_plan}"


def tasks_words(result: ClaimResult) -> str:
    """``4 of 4``."""
    return f"{len(result.covered)} of {len(result.tasks)}"


def exclusions(tasks: Iterable[TaskResult]) -> str:
    """Why tasks are missing or cannot be tested, equal reasons once: ``no runs on Ant-v4; no finished run of AAN on
    Hopper-v4``; empty where there are none.
    """
    arms: dict[tuple[Reason, str], set[str]] = {}
    details: dict[Reason, list[str]] = {}
    for task in tasks:
        if task.exclusion:
            arms.setdefault((task.exclusion.reason, task.env), set()).update(task.exclusion.arms)
            details.setdefault(task.exclusion.reason, []).extend(task.exclusion.details)
    found = []
    for reason, words in REASONS.items():
        groups: dict[tuple[str, ...], list[str]] = {}
        for env in ordered_tasks(env for key, env in arms if key is reason):
            mine = tuple(ordered_arms(arms[reason, env])) if "{arms}" in words else ()
            groups.setdefault(mine, []).append(env)
        phrases = [
            words.format(arms=", ".join(map(actor_name, mine)), tasks=", ".join(map(task_name, envs)))
            for mine, envs in groups.items()
        ]
        if phrases and details.get(reason):
            phrases[-1] += f" ({'; '.join(dict.fromkeys(details[reason]))})"
        found += phrases
    return "; ".join(found)


def divergence_words(arms: Iterable[ArmSummary], diverged: WithoutDivergence | None) -> str:
    """``diverged runs: BPT-SAN 1; with a random policy's score for them: undecided, without them: supported``."""
    counts = ", ".join(f"{actor_name(arm.name)} {arm.diverged}" for arm in arms if arm.diverged)
    if not counts:
        return ""
    if diverged is None:
        return f"diverged runs: {counts}"
    random, left_out = (verdict or "no verdict" for verdict in (diverged.random_score, diverged.left_out))
    return f"diverged runs: {counts}; with a random policy's score for them: {random}, without them: {left_out}"


def bimodality_words(task: TaskResult) -> str:
    """Which arms fall into two groups, the share of seeds below half of the reference, and P(improvement)."""
    split = [arm for arm in task.arms if arm.bimodal]
    if not split:
        return ""
    shares = ", ".join(f"{actor_name(arm.name)} {arm.below_half:.0%}" for arm in task.arms)
    words = f"two groups of seeds in {', '.join(actor_name(arm.name) for arm in split)}, so means mislead"
    words += f"; seeds below half of the reference: {shares}"
    if task.improvement:
        words += f"; P(improvement) {task.improvement.probability:.2f}"
    return words


def beyond_plan_words(tasks: Iterable[TaskResult], planned: int) -> str:
    """Which arms have seeds that the plan does not count; empty where there are none."""
    counts: dict[str, int] = {}
    for task in tasks:
        for arm in task.arms:
            counts[arm.name] = max(counts.get(arm.name, 0), arm.beyond_plan)
    shown = ", ".join(f"{actor_name(name)} {count}" for name, count in counts.items() if count)
    return f"seeds beyond the plan (0 to {planned - 1}), drawn but not judged: {shown}" if shown else ""


def removes_words(claim: Claim) -> str:
    """``removes the learning rate and the number of parameters``; empty for a claim that is no control."""
    return f"removes {_and(claim.removes)}" if claim.removes else ""


def confound_words(result: ClaimResult, values: bool = False) -> str:
    """``confounded by the learning rate and the number of parameters``, with the arms' values where asked for."""
    if not values:
        return f"confounded by {_and(result.confounds)}" if result.confounds else ""
    found: dict[str, dict[str, list[str]]] = {}
    for task in result.tasks:
        for confound in task.confounds:
            found.setdefault(confound.name, {}).setdefault(confound.values, []).append(task_name(task.env))
    with_runs = sum(bool(task.arms) and all(arm.n for arm in task.arms) for task in result.tasks)
    shown = []
    for name, tasks in found.items():
        each = [f"{words} on {', '.join(envs)}" if len(envs) < with_runs else words for words, envs in tasks.items()]
        shown.append(f"{name} ({'; '.join(each)})")
    return f"confounded by {_and(shown)}" if shown else ""


def own_reference_words(tasks: Iterable[TaskResult]) -> str:
    """On which tasks 100 is the study's own AAN."""
    own = ordered_tasks({task.env for task in tasks if task.scale and task.scale.own})
    return f"100 is this study's own AAN on {', '.join(map(task_name, own))}" if own else ""


def headline(judgement: Judgement) -> str:
    """The first screen's sentence: what the declared claims came to, or why nothing is judged."""
    results = judgement.results
    if not results:
        return "No runs, so no verdicts."
    planned = judgement.rule.planned_seeds
    if judgement.too_few_seeds:
        n = max(result.n for result in results)
        if n == 0:
            return "No claim can be tested with these runs."
        seeds = f"{n} finished seed{'s' * (n != 1)}"
        return (
            f"Too few seeds to judge: no claim has more than {seeds} in all of its arms; {TEST_SEEDS} are needed and "
            f"{planned} planned."
        )
    first = next(family for family in Family if any(r.claim.family is family for r in results))
    chosen: list[tuple[str, str, str]] = []
    for one in judgement.over_algorithms:
        if one.claim.family is first:
            chosen.append((" and ".join(map(algorithm_name, one.algos)), verdict_words(one), one.claim.text))
    if not chosen:
        for result in results:
            if result.claim.family is first:
                stage = stage_words(result, planned)
                where = f"{algorithm_name(result.algo)}{f' ({stage})' if stage else ''}"
                chosen.append((where, verdict_words(result), result.claim.text))
    groups: dict[str, dict[str, list[str]]] = {}
    for where, words, text in chosen:
        groups.setdefault(where, {}).setdefault(words, []).append(text)
    return " ".join(
        f"{where}: {'; '.join(f'{words}: {_list(words, texts)}' for words, texts in kinds.items())}."
        for where, kinds in groups.items()
    )


def _list(words: str, texts: list[str]) -> str:
    """The claims of a verdict; of many that decide nothing their number."""
    open_ends = (str(Verdict.UNDECIDED), str(Verdict.NOT_TESTABLE), str(Verdict.TOO_FEW_SEEDS))
    return f"{len(texts)} claims" if words in open_ends and len(texts) > MOST_CLAIMS else ", ".join(texts)


def _and(names: Sequence[str]) -> str:
    return " and ".join(filter(None, (", ".join(names[:-1]), names[-1])))


def rule_words(judgement: Judgement) -> list[str]:
    """The verdict rule with this file's numbers, and what it can detect."""
    rule = judgement.rule
    planned_tasks = f" on {_and([task_name(env) for env in rule.tasks])}" if rule.tasks_planned else ""
    sentences = [
        "Seeds are the unit; final performance is compared, in normalised points (100: the AAN reference). An answer "
        "is one contrast of means pooled over the tasks, Welch's test with Welch–Satterthwaite degrees of freedom, "
        "two-sided, Holm's correction over a family's claims under one algorithm; one that cannot be tested counts "
        f"with p = 1. Supported: adjusted p below {rule.alpha:g} in the claimed direction; contradicted: in the other; "
        f"else undecided, which is not equality. Fewer than {TEST_SEEDS} seeds in an arm are not judged.",
        "Tasks have a verdict only where the pooled effect of their claim is decided; Holm over all of these rows. On "
        "every task: twice the largest one-sided p of the tasks, Holm over the claims; one contradicted task "
        f"contradicts. No relevant difference: the pooled 90% interval lies within ±{rule.smallest_effect:g} points, "
        "also if one more run of an arm had failed.",
        f"Seeds 0 to {rule.planned_seeds - 1}{planned_tasks} decide. Before all have finished only the pooled effect "
        f"is judged, at adjusted p below {rule.interim_alpha:g}. The paper's claims take the paper's actors only; "
        f"labels that no claim names are compared with {', '.join(map(actor_name, rule.baselines))}, as exploratory.",
    ]
    declared = sum(claim.family is Family.DECLARED for claim in rule.claims)
    if declared:
        tasks = len(rule.tasks)
        weights = [sign / tasks for _ in range(tasks) for sign in (1.0, -1.0)]
        effects = [
            f"{n} seeds: {detectable_effect(n, weights, rule.alpha / declared, rule.power):.1f}"
            for n in dict.fromkeys((TEST_SEEDS, rule.planned_seeds))
        ]
        sentences.append(
            f"A difference pooled over {tasks} task{'s' * (tasks != 1)} that is detected with {rule.power:.0%} power "
            f"at the first of {declared} Holm steps, in standard deviations between seeds: {', '.join(effects)}."
        )
    return sentences
