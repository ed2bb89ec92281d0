"""Probability of improvement for each pair of a claim, per task and over tasks."""

from __future__ import annotations

import numpy as np
import pandas as pd

from analysis.bootstrap import improvement_interval
from analysis.cells import Cell, select
from analysis.claims_file import read_claims
from analysis.figures.drawing import Drawing
from analysis.improvement import probability_of_improvement
from analysis.names import actor_name, algorithm_name, task_name
from analysis.study import Study
from analysis.style import panels
from analysis.tests_of_claims import MINIMUM_SEEDS


def draw(study: Study, cells: list[Cell], algo: str) -> list[Drawing]:
    """``improvement-<algo>``: P(a seed of X beats a seed of Y), ties half."""
    name, title = f"improvement-{algo}", f"Probability of improvement, {algorithm_name(algo)}"
    caption = (
        "Probability that a run of the first actor ends better than a run of the second, ties half; “all tasks”: the "
        "mean over the "
        "tasks shown. Lines: 95% stratified bootstrap interval (from three seeds in both). At 0.5 neither is better. "
        "Final performance."
    )
    rows = []
    for claim in read_claims().claims:
        if claim.kind != "difference":
            continue
        pairs = {}
        for env in dict.fromkeys(cell.env for cell in select(cells, algo)):
            found = [select(cells, algo, env, arm) for arm in claim.arms]
            if all(f and f[0].n and (f[0].paper or claim.source == "user") for f in found):
                pairs[env] = (found[0][0].final, found[1][0].final)
        label = f"{actor_name(claim.arms[0])} > {actor_name(claim.arms[1])}"
        groups = {task_name(env): [pair] for env, pair in pairs.items()}
        if len(pairs) > 1:
            groups["all tasks"] = list(pairs.values())
        for where, group in groups.items():
            x, y = [a for a, _ in group], [b for _, b in group]
            enough = min(len(v) for v in (*x, *y)) >= MINIMUM_SEEDS
            low, high = improvement_interval(x, y) if enough else (np.nan, np.nan)
            n = "; ".join(f"{len(a)} against {len(b)}" for a, b in zip(x, y))
            rows.append(
                {
                    "pair": label,
                    "where": where,
                    "n": n,
                    "probability": probability_of_improvement(x, y),
                    "low": low,
                    "high": high,
                }
            )
    if not rows:
        return [Drawing(name, title, caption, missing="No pair of a claim has finished runs of both actors.")]
    frame = pd.DataFrame(rows)
    pairs_shown = list(dict.fromkeys(frame["pair"]))
    height = 0.55 + 0.19 * int(frame.groupby("pair").size().max())
    figure, axes = panels(len(pairs_shown), width=3.5, height=height, columns=2)
    for index, (axis, pair) in enumerate(zip(axes, pairs_shown)):
        mine = frame[frame["pair"] == pair].reset_index(drop=True)
        for place, row in mine.iterrows():
            every = row["where"] == "all tasks"
            axis.plot(
                [row["low"], row["high"]],
                [place, place],
                color="#0072B2",
                linewidth=5 if every else 3,
                alpha=0.45,
                solid_capstyle="butt",
            )
            axis.plot(row["probability"], place, marker="D" if every else "o", color="#0072B2", markersize=5)
        axis.axvline(0.5, color="black", linewidth=0.8, linestyle=(0, (3, 2)))
        axis.set_xlim(-0.03, 1.03)
        axis.set_yticks(range(len(mine)), list(mine["where"]))
        axis.set_ylim(len(mine) - 0.5, -0.5)
        axis.set_title(pair, fontsize=8)
        axis.grid(False, axis="y")
        if index >= len(pairs_shown) - 2:
            axis.set_xlabel("Probability of improvement")
    return [Drawing(name, title, caption, figure=figure, data=frame)]
