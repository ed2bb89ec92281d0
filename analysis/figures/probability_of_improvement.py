"""Probability of improvement for each claim about two actors, by task and over tasks."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from analysis.claims_file import Kind
from analysis.coverage import covers
from analysis.data.cells import select
from analysis.data.names import actor_name, algorithm_name, task_name
from analysis.figures.drawing import Drawing
from analysis.figures.view import View
from analysis.hypothesis_tests import INTERVAL_SEEDS
from analysis.improvement import SEPARATED, improvement_with_interval
from analysis.style import panels
from analysis.verdicts import ClaimResult, Reason
from analysis.verdicts.wording import exclusions


def draw(view: View) -> list[Drawing]:
    """``improvement-<algo>``: P(a seed of X beats a seed of Y), ties half; a line per claim, a dot per task."""
    name, title = f"improvement-{view.algo}", f"Probability of improvement, {algorithm_name(view.algo)}"
    caption = (
        "Probability that a run of the first actor ends better than a run of the second, ties half. Diamond: mean over "
        f"the tasks on which both have finished runs; line: its 95% stratified bootstrap interval (from "
        f"{INTERVAL_SEEDS} seeds on); dots: the tasks. {covers('improvement')} {SEPARATED} At 0.5 neither is better."
    )
    claims = [
        result for result in view.judgement.results if result.algo == view.algo and result.claim.kind is Kind.DIFFERENCE
    ]
    rows = [row for result in claims for row in _rows(view, result)]
    unequal = [
        task
        for result in claims
        for task in result.tasks
        if task.exclusion and task.exclusion.reason is Reason.UNEQUAL_SETTINGS
    ]
    skipped = f"Not drawn: {exclusions(unequal)}." if unequal else ""
    if not rows:
        missing = skipped.removeprefix("Not drawn: ") or "No pair of a claim has finished runs of both actors."
        return [Drawing(name, title, caption, missing=missing, folded=True)]
    caption = f"{caption} {skipped}".strip()
    frame = pd.DataFrame(rows)
    pairs = list(dict.fromkeys(frame["pair"]))
    figure, (axis,) = panels(view.style, 1, width=4.6, height=0.5 + 0.24 * len(pairs))
    for position, pair in enumerate(pairs):
        mine = frame[frame["pair"] == pair]
        tasks, mean = mine[mine["where"] != "mean"], mine[mine["where"] == "mean"].iloc[0]
        axis.plot(
            [mean["low"], mean["high"]],
            [position, position],
            color="#0072B2",
            linewidth=5,
            alpha=0.4,
            solid_capstyle="butt",
        )
        offsets = np.linspace(-0.2, 0.2, len(tasks)) if len(tasks) > 1 else np.zeros(len(tasks))
        axis.scatter(tasks["probability"], position + offsets, s=8, color="#777777", zorder=2)
        axis.plot(mean["probability"], position, marker="D", color="#0072B2", markersize=4)
    axis.axvline(0.5, color="black", linewidth=0.8, linestyle=(0, (3, 2)))
    axis.set_xlim(-0.03, 1.03)
    axis.set_yticks(range(len(pairs)), pairs)
    axis.set_ylim(len(pairs) - 0.5, -0.5)
    axis.grid(False, axis="y")
    axis.set_xlabel("P(improvement)")
    means = frame[frame["where"] == "mean"]
    shown = [f"{pair} {value:.2f}" for pair, value in zip(means["pair"], means["probability"])]
    alt = f"Mean probability of improvement: {', '.join(shown)}."
    return [Drawing(name, title, caption, figure=figure, data=frame, alt=alt, folded=True)]


def _rows(view: View, result: ClaimResult) -> list[dict[str, Any]]:
    """A row per task with an improvement, and their mean over tasks."""
    found = [task for task in result.tasks if task.improvement is not None]
    if not found:
        return []
    pair = f"{actor_name(result.claim.arms[0])} > {actor_name(result.claim.arms[1])}"
    arms = [[select(view.here, env=task.env, arm=arm)[0].final for task in found] for arm in result.claim.arms]
    over_tasks = improvement_with_interval(arms[0], arms[1])
    names = [task_name(task.env) for task in found] + ["mean"]
    values = [(t.improvement.probability, t.improvement.low, t.improvement.high) for t in found if t.improvement]
    counts = [" / ".join(str(arm.n) for arm in task.arms) for task in found] + [f"{len(found)} tasks"]
    return [
        {"pair": pair, "where": where, "n": n, "probability": value, "low": low, "high": high}
        for where, n, (value, low, high) in zip(names, counts, [*values, over_tasks])
    ]
