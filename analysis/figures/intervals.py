"""Aggregates over tasks with 95% stratified bootstrap intervals (Agarwal et al. 2021)."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.ticker import MaxNLocator

from analysis import bootstrap
from analysis.coverage import AGGREGATES, covers
from analysis.data.names import actor_name, algorithm_name
from analysis.figures.drawing import Drawing
from analysis.figures.over_tasks import arms_and_tasks, none, tasks_in_words, those_left_out
from analysis.figures.view import View
from analysis.hypothesis_tests import INTERVAL_SEEDS
from analysis.statistics.aggregates import METRICS, table
from analysis.style import arm_styles, leftmost, panels


def draw(view: View) -> list[Drawing]:
    """``intervals-<algo>``: IQM, median, mean and optimality gap of normalised final performance."""
    name, title = f"intervals-{view.algo}", f"Over all tasks, {algorithm_name(view.algo)}"
    arms, tasks = arms_and_tasks(view)
    caption = (
        f"Normalised final performance over {tasks_in_words(tasks)}. Points: the aggregate; bars: 95% stratified "
        f"bootstrap intervals over seeds (from {INTERVAL_SEEDS} seeds on). {covers(*AGGREGATES)} "
        f"{bootstrap.IQM} Higher is better, except for the optimality gap. Only actors with finished runs on all of "
        "these tasks are shown." + those_left_out(view)
    )
    if not arms:
        return none(name, title, caption, view)
    frame, styles = table(view.cells, view.claims).frame, arm_styles(arms)
    frame = frame[(frame["algo"] == view.algo) & frame["arm"].isin(arms)].set_index("arm").loc[arms]
    figure, axes = panels(view.style, len(METRICS), width=1.9, height=0.8 + 0.22 * len(arms))
    for axis, (key, (label, _)) in zip(axes, METRICS.items()):
        for position, arm in enumerate(arms):
            row, style = frame.loc[arm], styles[arm]
            if not np.isnan(row[f"{key}_low"]):
                axis.plot(
                    [row[f"{key}_low"], row[f"{key}_high"]],
                    [position, position],
                    color=style.color,
                    linewidth=6,
                    alpha=0.4,
                    solid_capstyle="butt",
                )
            axis.plot(row[key], position, marker=style.marker, color=style.color, markersize=5)
        first = axis in leftmost(axes)
        axis.set_yticks(range(len(arms)), list(map(actor_name, arms)) if first else [""] * len(arms))
        axis.set_ylim(len(arms) - 0.5, -0.5)
        axis.xaxis.set_major_locator(MaxNLocator(4))
        axis.set_title(label)
        axis.grid(False, axis="y")
    figure.supxlabel("Normalised score", fontsize=8)
    columns = ["n", *(f"{key}{end}" for key in METRICS for end in ("", "_low", "_high"))]
    alt = "Interquartile mean of normalised scores: " + ", ".join(
        f"{actor_name(arm)} {shown}" for arm, shown in zip(arms, frame["iqm_shown"])
    )
    data = pd.DataFrame(frame[columns].reset_index())
    return [Drawing(name, title, caption, figure=figure, data=data, alt=f"{alt}.", folded=True)]
