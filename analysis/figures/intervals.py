"""Aggregates over tasks with 95% stratified bootstrap intervals (Agarwal et al. 2021)."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.ticker import MaxNLocator

from analysis import bootstrap
from analysis.claims_file import Claims
from analysis.data.cells import Cell
from analysis.data.names import actor_name, algorithm_name, task_name
from analysis.data.study import Study
from analysis.figures.drawing import Drawing
from analysis.statistics.aggregates import METRICS, complete_arms, left_out, table, tasks_of
from analysis.style import looks, panels


def draw(study: Study, cells: list[Cell], algo: str, claims: Claims) -> list[Drawing]:
    """``intervals-<algo>``: IQM, median, mean and optimality gap of normalised final performance."""
    name, title = f"intervals-{algo}", f"Over all tasks, {algorithm_name(algo)}"
    tasks, arms = tasks_of(cells, algo, claims), complete_arms(cells, algo, claims)
    caption = (
        f"Normalised final performance over {', '.join(map(task_name, tasks)) or 'no task'}: 0 a random policy, 100 a "
        "published AAN after 1,000,000 steps. Points: the aggregate; bars: 95% stratified bootstrap intervals over "
        "seeds "
        f"(none below three seeds). {bootstrap.FEW_SEEDS} {bootstrap.IQM} Higher is better, except for the "
        "optimality gap. Only actors with finished runs on all of these tasks are shown."
        + left_out(cells, algo, claims)
    )
    if not arms:
        return [
            Drawing(
                name,
                title,
                caption,
                missing="No actor has finished runs on every task that has a reference score."
                + left_out(cells, algo, claims),
            )
        ]
    frame, style = table(cells, claims).frame, looks(arms)
    frame = frame[(frame["algo"] == algo) & frame["arm"].isin(arms)].set_index("arm").loc[arms]
    figure, axes = panels(len(METRICS), width=1.9, height=0.8 + 0.26 * len(arms))
    for axis, (key, (label, _)) in zip(axes, METRICS.items()):
        for place, arm in enumerate(arms):
            row, look = frame.loc[arm], style[arm]
            if not np.isnan(row[f"{key}_low"]):
                axis.plot(
                    [row[f"{key}_low"], row[f"{key}_high"]],
                    [place, place],
                    color=look.color,
                    linewidth=6,
                    alpha=0.4,
                    solid_capstyle="butt",
                )
            axis.plot(row[key], place, marker=look.marker, color=look.color, markersize=5)
        axis.set_yticks(range(len(arms)), list(map(actor_name, arms)) if axis is axes[0] else [""] * len(arms))
        axis.set_ylim(len(arms) - 0.5, -0.5)
        axis.xaxis.set_major_locator(MaxNLocator(4))
        axis.set_title(label)
        axis.grid(False, axis="y")
    figure.supxlabel("Normalised score", fontsize=8)
    columns = ["n", *(f"{key}{end}" for key in METRICS for end in ("", "_low", "_high"))]
    return [Drawing(name, title, caption, figure=figure, data=pd.DataFrame(frame[columns].reset_index()))]
