"""The paper's figures ablation-td3 and ablation-sac, for any actor: max average return of variants of a base."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from analysis import metrics
from analysis.data.cells import Cell, select
from analysis.data.names import actor_name, algorithm_name, ordered_arms, task_name
from analysis.figures.drawing import Drawing
from analysis.figures.view import View
from analysis.style import ArmStyle, arm_styles, lowest, panels

PAPER_BASE = "bptsan"


def draw(view: View) -> list[Drawing]:
    """``ablation-<algo>`` for BPT-SAN's family, ``ablation-<algo>-<base>`` for each other base with a variant."""
    found = families(view)
    drawings = [_drawing(view, base, arms) for base, arms in found.items()]
    if not drawings:
        missing = "No two finished actors share a base (an actor with a changed key, or one named BASE_wo_SOMETHING)."
        title = f"Ablation, {algorithm_name(view.algo)}: max average return"
        drawings = [Drawing(f"ablation-{view.algo}", title, "", missing=missing, folded=True)]
    return drawings


def families(view: View) -> dict[str, list[str]]:
    """Base to its arms with finished runs, the base first, where there are at least two.

    The base of an arm is its actor, without what follows ``_wo_`` in the actor's name.
    """
    actors = dict(zip(view.study.runs["arm"], view.study.runs["actor"]))
    finished = ordered_arms({cell.arm for cell in view.here if cell.n})
    groups: dict[str, list[str]] = {}
    for arm in finished:
        groups.setdefault(str(actors[arm]).partition("_wo_")[0], []).append(arm)
    ordered = sorted(groups, key=lambda base: (base != PAPER_BASE, base))
    return {base: sorted(groups[base], key=lambda arm: arm != base) for base in ordered if len(groups[base]) > 1}


def _drawing(view: View, base: str, arms: list[str]) -> Drawing:
    name = f"ablation-{view.algo}" + ("" if base == PAPER_BASE else f"-{base}")
    title = f"Ablation of {actor_name(base)}, {algorithm_name(view.algo)}: max average return"
    caption = (
        f"Variants of {actor_name(base)}. Bars: max_of_mean, the largest value of the seeds' mean curve; whiskers: one "
        "standard deviation over seeds at that step (ddof=1); dots: the seeds there. Nothing is smoothed. The other "
        "reading, mean_of_max, stands in the CSV and in the table “Max average return”. Diverged runs count with their "
        "last value."
    )
    here = [cell for cell in view.here if cell.arm in arms and cell.n]
    tasks, styles = list(dict.fromkeys(cell.env for cell in here)), arm_styles(ordered_arms(arms))
    labels = 0.062 * max(len(actor_name(arm)) for arm in arms)
    figure, axes = panels(
        view.style, len(tasks), width=1.6 + min(labels, 1.6), height=0.7 + 0.24 * len(arms), columns=4
    )
    rows = []
    for axis, env in zip(axes, tasks):
        counts = []
        for position, arm in enumerate(arms):
            found = select(here, env=env, arm=arm)
            counts.append(f"n={found[0].n}" if found else "no run")
            if found:
                rows.append(_bar(axis, position, found[0], styles[arm]))
        axis.set_yticks(range(len(arms)), [f"{actor_name(arm)} ({n})" for arm, n in zip(arms, counts)])
        axis.set_ylim(len(arms) - 0.4, -0.6)
        axis.grid(False, axis="y")
        axis.set_title(task_name(env))
    for axis in lowest(axes):
        axis.set_xlabel("Max average return")
    alt = "Max average return (max_of_mean): " + "; ".join(
        f"{task_name(env)}: "
        + ", ".join(f"{actor_name(r['arm'])} {r['max_of_mean']:,.0f}" for r in rows if r["env"] == env)
        for env in tasks
    )
    return Drawing(
        name, title, caption, figure=figure, data=pd.DataFrame(rows), alt=f"{alt}.", folded=base != PAPER_BASE
    )


def _bar(axis: Axes, position: int, cell: Cell, style: ArmStyle) -> dict[str, Any]:
    """Draw one arm; the row of the CSV."""
    best, each = metrics.max_of_mean(cell.steps, cell.returns), metrics.mean_of_max(cell.returns)
    axis.barh(
        position,
        best.value,
        height=0.66,
        color=style.color,
        alpha=0.45,
        edgecolor="black",
        linewidth=0.8,
        hatch=style.hatch,
    )
    if not np.isnan(best.std):
        axis.errorbar(best.value, position, xerr=best.std, color="black", capsize=3, linewidth=1)
    points = cell.returns[:, cell.steps == best.step].ravel()
    offsets = np.linspace(-0.18, 0.18, len(points)) if len(points) > 1 else np.zeros(len(points))
    axis.scatter(points, position + offsets, s=9, color="white", edgecolor="black", linewidth=0.6, zorder=3)
    return {
        "env": cell.env,
        "arm": cell.arm,
        "n": cell.n,
        "max_of_mean": best.value,
        "max_of_mean_std": best.std,
        "step": best.step,
        "mean_of_max": each.value,
        "mean_of_max_std": each.std,
        "seeds": " ".join(map(repr, points.tolist())),
    }
