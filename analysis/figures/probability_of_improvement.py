"""Probability of improvement for each pair of a claim, per task and over tasks."""

from __future__ import annotations

import numpy as np
import pandas as pd

from analysis import bootstrap
from analysis.claims_file import Claim, Claims, Family, Kind
from analysis.data.cells import Cell, select
from analysis.data.confounds import confounds
from analysis.data.names import actor_name, algorithm_name, task_name
from analysis.data.study import Study
from analysis.figures.drawing import Drawing
from analysis.hypothesis_tests import INTERVAL_SEEDS
from analysis.improvement import SEPARATED, improvement_with_interval
from analysis.style import panels


def draw(study: Study, cells: list[Cell], algo: str, claims: Claims) -> list[Drawing]:
    """``improvement-<algo>``: P(a seed of X beats a seed of Y), ties half."""
    name, title = f"improvement-{algo}", f"Probability of improvement, {algorithm_name(algo)}"
    rows: list[dict[str, object]] = []
    unequal: list[str] = []
    for claim in claims.claims:
        if claim.kind is Kind.DIFFERENCE:
            rows += _rows(study, cells, algo, claim, claims, unequal)
    caption = (
        "Probability that a run of the first actor ends better than a run of the second, ties half, on the claims' "
        "tasks; "
        "diamond: the mean over so many of them. Lines: 95% stratified bootstrap interval (from "
        f"{INTERVAL_SEEDS} seeds in both). {bootstrap.FEW_SEEDS} {SEPARATED} At 0.5 neither is better. Final "
        "performance."
    )
    skipped = (
        f"Not drawn, because the arms were trained under different settings: {'; '.join(unequal)}." if unequal else ""
    )
    if not rows:
        missing = skipped or "No pair of a claim has finished runs of both actors."
        return [Drawing(name, title, caption, missing=missing)]
    caption = f"{caption} {skipped}".strip()
    frame = pd.DataFrame(rows)
    pairs_shown = list(dict.fromkeys(frame["pair"]))
    height = 0.55 + 0.19 * int(frame.groupby("pair").size().max())
    figure, axes = panels(len(pairs_shown), width=3.5, height=height, columns=2)
    for index, (axis, pair) in enumerate(zip(axes, pairs_shown)):
        mine = frame[frame["pair"] == pair].reset_index(drop=True)
        for place, row in mine.iterrows():
            every = str(row["where"]).startswith("mean of ")
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


def _rows(
    study: Study, cells: list[Cell], algo: str, claim: Claim, claims: Claims, unequal: list[str]
) -> list[dict[str, object]]:
    """A row per task on which both arms have finished runs under the same settings, and their mean."""
    pairs: dict[str, tuple[np.ndarray, np.ndarray]] = {}
    label = f"{actor_name(claim.arms[0])} > {actor_name(claim.arms[1])}"
    for env in claims.tasks:
        found = [select(cells, algo, env, arm) for arm in claim.arms]
        if not all(f and f[0].n and (f[0].paper or claim.family is not Family.DECLARED) for f in found):
            continue
        if differing := confounds(study, algo, env, claim.arms):
            unequal.append(f"{label} on {task_name(env)} ({', '.join(differing)})")
        else:
            pairs[env] = (found[0][0].final, found[1][0].final)
    groups = {task_name(env): [pair] for env, pair in pairs.items()}
    if len(pairs) > 1:
        groups[f"mean of {len(pairs)} of {len(claims.tasks)} tasks"] = list(pairs.values())
    rows: list[dict[str, object]] = []
    for where, group in groups.items():
        x, y = [a for a, _ in group], [b for _, b in group]
        value, low, high = improvement_with_interval(x, y)
        n = "; ".join(f"{len(a)} against {len(b)}" for a, b in group)
        rows.append({"pair": label, "where": where, "n": n, "probability": value, "low": low, "high": high})
    return rows
