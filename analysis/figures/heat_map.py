"""Final performance over the values of two keys (``--by KEY1,KEY2``), a panel per task and actor."""

from __future__ import annotations

import numpy as np
import pandas as pd

from analysis.data.names import algorithm_name, ordered_tasks, task_name
from analysis.figures.drawing import Drawing
from analysis.figures.swept import ordered_values, runs_by
from analysis.figures.view import View
from analysis.style import leftmost, lowest, panels


def draw(view: View) -> list[Drawing]:
    """``heat-<algo>-<key>-<key>``; none where not two keys were asked for."""
    if len(view.by) != 2:
        return []
    first, second = view.by
    name, title = f"heat-{view.algo}-{first}-{second}", f"Return over {first} and {second}, {algorithm_name(view.algo)}"
    runs = runs_by(view.study, view.algo, view.by)
    if runs.empty:
        missing = f"No finished run has both {first} and {second}."
        return [Drawing(name, title, "", missing=missing)]
    runs = runs.assign(first=[value[0] for value in runs["value"]], second=[value[1] for value in runs["value"]])
    most = [runs.groupby(["env", "line"])[side].nunique().max() for side in ("first", "second")]
    table = (
        runs.groupby(["env", "line", "first", "second"])["final"].agg(["mean", "std", "count"]).reset_index()
        .rename(columns={"first": first, "second": second, "count": "n"})
    )  # fmt: skip
    panel_keys = [(env, line) for env in ordered_tasks(runs["env"]) for line in dict.fromkeys(runs["line"])]
    panel_keys = [facet for facet in panel_keys if ((table["env"] == facet[0]) & (table["line"] == facet[1])).any()]
    size = 1.2 + 0.55 * most[1]
    figure, axes = panels(view.style, len(panel_keys), width=max(size, 2.2), height=0.9 + 0.3 * most[0], columns=3)
    for axis, (env, line) in zip(axes, panel_keys):
        mine = table[(table["env"] == env) & (table["line"] == line)]
        down, across = ordered_values(mine[first]), ordered_values(mine[second])
        grid, counts = (
            mine.pivot(index=first, columns=second, values=what).reindex(down, columns=across) for what in ("mean", "n")
        )
        image = axis.imshow(grid.to_numpy(dtype=float), cmap="viridis", aspect="auto")
        for (row, column), value in np.ndenumerate(grid.to_numpy(dtype=float)):
            if np.isnan(value):
                axis.text(column, row, "–", ha="center", va="center", fontsize=7)
                continue
            shade = float(np.asarray(image.norm(value)))
            words = f"{value:,.0f}\n(n={int(counts.iat[row, column])})"
            dark = np.isfinite(shade) and shade < 0.6
            axis.text(column, row, words, ha="center", va="center", fontsize=7, color="white" if dark else "black")
        axis.set_xticks(range(len(across)), list(map(str, across)))
        axis.set_yticks(range(len(down)), list(map(str, down)))
        axis.set_title(f"{task_name(env)}, {line}", fontsize=8)
        axis.grid(False)
    for axis in lowest(axes):
        axis.set_xlabel(second)
    for axis in leftmost(axes):
        axis.set_ylabel(first)
    caption = (
        f"Mean final performance by {first} (rows) and {second} (columns), n: seeds; each panel has its own scale of "
        "colours, dark is low. A dash: no finished run."
    )
    best = table.loc[table.groupby(["env", "line"])["mean"].idxmax()]
    alt = "Highest mean final performance: " + "; ".join(
        f"{task_name(row['env'])}, {row['line']}: {row['mean']:,.0f} at {first} {row[first]}, {second} {row[second]}"
        for _, row in best.iterrows()
    )
    return [Drawing(name, title, caption, figure=figure, data=pd.DataFrame(table), alt=f"{alt}.")]
