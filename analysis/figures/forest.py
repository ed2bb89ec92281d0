"""The forest plot: the pooled effect of every claim with its interval, its tasks under it."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from analysis.coverage import covers
from analysis.data.names import algorithm_name
from analysis.figures.drawing import Drawing
from analysis.figures.view import View
from analysis.forest_rows import ForestRow, limits, rows_of
from analysis.style import panels

#: More rows than this fill a page: then the claims stand without their tasks.
MOST_ROWS = 45


def draw(view: View) -> list[Drawing]:
    """``forest-<algo>``; its rows are those of the page's first screen."""
    name, title = f"forest-{view.algo}", f"Claims, {algorithm_name(view.algo)}"
    rows = rows_of(view.judgement, view.algo)
    band = view.claims.smallest_effect
    caption = (
        "Effect of each claim in normalised points (0: random policy, 100: AAN reference), pooled over its tasks, with "
        f"its unadjusted 95% interval; its tasks under it. Grey: effects below the smallest relevant one, ±{band:g} "
        f"points. Right of zero: as claimed. {covers('pooled')}"
    )
    drawn = [row for row in rows if not np.isnan(row.estimate)]
    if len(drawn) > MOST_ROWS:
        drawn = [row for row in drawn if row.pooled]
    if not drawn:
        return [
            Drawing(name, title, caption, "answer", missing="No claim has finished runs of all its actors on any task.")
        ]
    figure, (axis,) = panels(view.style, 1, width=6.4, height=0.45 + 0.19 * len(drawn))
    low, high = limits(rows, band)
    axis.axvspan(-band, band, color="#e4e4de", linewidth=0)
    axis.axvline(0, color="black", linewidth=0.8, linestyle=(0, (3, 2)))
    for position, row in enumerate(drawn):
        _row(axis, position, row)
    axis.set_xlim(low, high)
    axis.set_yticks(range(len(drawn)), [row.label if row.pooled else f"{row.label}   " for row in drawn])
    for label, row in zip(axis.get_yticklabels(), drawn):
        label.set_fontweight("bold" if row.pooled else "normal")
    axis.set_ylim(len(drawn) - 0.5, -0.6)
    axis.grid(False, axis="y")
    axis.set_xlabel("Effect (normalised points)")
    data = pd.DataFrame([row.record() for row in drawn])
    alt = "; ".join(f"{row.label}: {row.effect} ({row.verdict or 'no verdict'})" for row in drawn if row.pooled)
    return [Drawing(name, title, caption, "answer", figure, data, alt=f"{alt}.")]


def _row(axis: Axes, position: int, row: ForestRow) -> None:
    color = "black" if row.pooled else "#666666"
    axis.plot([row.low, row.high], [position, position], color=color, linewidth=1.6 if row.pooled else 0.9)
    axis.plot(
        row.estimate, position, marker="D" if row.pooled else "o", color=color, markersize=4.5 if row.pooled else 3
    )
    words = f"{row.n}  {row.verdict}".rstrip()
    axis.annotate(words, (1.01, position), xycoords=("axes fraction", "data"), va="center", fontsize=7, color=color)
