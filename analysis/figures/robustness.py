"""Scores under graded disturbances: a figure per task, a panel per disturbance, a line per actor."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib import pyplot as plt
from matplotlib.axes import Axes

from analysis.data.names import actor_name, algorithm_name, ordered_arms, ordered_tasks, task_name
from analysis.data.robustness import NONE
from analysis.figures.drawing import Drawing
from analysis.figures.view import View
from analysis.references import scale
from analysis.robustness import summary
from analysis.style import arm_styles

COLUMNS = 4


def draw(view: View) -> list[Drawing]:
    """``robustness-<algo>-<task>``; none where no policy was disturbed."""
    played = view.study.robustness[view.study.robustness["algo"] == view.algo]
    return [_drawing(view, env, played[played["env"] == env]) for env in ordered_tasks(played["env"])]


def _drawing(view: View, env: str, played: pd.DataFrame) -> Drawing:
    known = scale(view.cells, view.algo, env, view.claims)
    table = summary(played, known)
    disturbances = [name for name in table["disturbance"].unique() if name != NONE]
    arms = ordered_arms(table["arm"])
    rows = max(1, -(-len(disturbances) // COLUMNS))
    size = (view.style.width(9.6), 2.1 * rows + 0.5)
    figure, axes = plt.subplots(rows, COLUMNS, figsize=size, sharey=True, squeeze=False)
    for axis, disturbance in zip(axes.flat, disturbances):
        _panel(axis, table, disturbance, arms)
    for axis in axes.flat[len(disturbances) :]:
        axis.set_axis_off()
    figure.supylabel("Mean return" if known is None else "Normalised score", fontsize=8)
    handles, labels = axes[0][0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=min(5, len(arms)))
    worst = table[table["disturbance"] != NONE].sort_values("change").groupby("arm", sort=False).head(1)
    alt = "; ".join(
        f"{actor_name(str(row.arm))} loses most under {row.disturbance} {row.severity:g} "
        f"({row.change:+.1f}, n = {row.n})"
        for row in worst.itertuples()
    )
    title = f"Robustness, {algorithm_name(view.algo)}, {task_name(env)}"
    caption = (
        "Trained policies under disturbances, mean over seeds; none is the plain evaluation of the same policies in "
        "the same episodes. Bars: 95 % t interval of the difference to it over seeds, where there are at least two. "
        "The differences stand in the CSV; what the severities mean, in docs/policies.md."
    )
    name = f"robustness-{view.algo}-{env}"
    return Drawing(name, title, caption, "health", figure, table, alt=f"{alt}.", folded=True)


def _panel(axis: Axes, table: pd.DataFrame, disturbance: str, arms: list[str]) -> None:
    """Severities side by side at equal distances, the undisturbed policy among them as 0."""
    styles = arm_styles(arms)
    part = table[table["disturbance"].isin([NONE, disturbance])]
    shown = sorted(part["severity"].unique(), reverse=disturbance == "weight bits")
    if disturbance == "weight bits":  # 0 stands for no rounding: before 8
        shown = [0.0, *(severity for severity in shown if severity)]
    for index, arm in enumerate(arms):
        own = part[part["arm"] == arm].set_index("severity").reindex(shown)
        if own["n"].notna().sum() < 2:
            continue  # this actor can't have the disturbance
        positions = np.arange(len(shown)) + 0.06 * (index - (len(arms) - 1) / 2)
        half = (own["change_high"] - own["change"]).fillna(0.0)
        style = styles[arm]
        axis.errorbar(
            positions, own["score"], yerr=half, label=actor_name(arm), color=style.color, linestyle=style.line,
            marker=style.marker, markersize=3.5, linewidth=1.2, elinewidth=0.8, capsize=2,
        )  # fmt: skip
    axis.set_title(disturbance)
    axis.set_xticks(range(len(shown)), ["none" if severity == 0 else f"{severity:g}" for severity in shown])
