"""Performance profiles (Agarwal et al. 2021): the share of runs that score above each threshold."""

from __future__ import annotations

import numpy as np
import pandas as pd

from analysis import bootstrap
from analysis.claims_file import Claims
from analysis.data.cells import Cell
from analysis.data.names import actor_name, algorithm_name, task_name
from analysis.data.study import Study
from analysis.figures.drawing import Drawing
from analysis.hypothesis_tests import INTERVAL_SEEDS
from analysis.statistics.aggregates import complete_arms, left_out, scores_of, tasks_of
from analysis.style import legend_below, looks, panels


def draw(study: Study, cells: list[Cell], algo: str, claims: Claims) -> list[Drawing]:
    """``profile-<algo>`` over normalised final performance."""
    name, title = f"profile-{algo}", f"Performance profile, {algorithm_name(algo)}"
    tasks, arms = tasks_of(cells, algo, claims), complete_arms(cells, algo, claims)
    caption = (
        f"Share of runs whose normalised final performance exceeds a threshold, over "
        f"{', '.join(map(task_name, tasks)) or 'no task'}, tasks weighing the same; a curve above another at every "
        "threshold is better everywhere. Shaded: pointwise 95% stratified bootstrap interval (from three seeds on). "
        f"{bootstrap.FEW_SEEDS}" + left_out(cells, algo, claims)
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
    scores = {arm: [scores_of(cells, algo, arm)[env] for env in tasks] for arm in arms}
    every = np.concatenate([values for arm in arms for values in scores[arm]])
    thresholds = np.linspace(min(0.0, float(np.floor(every.min()))), max(float(np.ceil(every.max())), 10.0), 101)
    figure, (axis,) = panels(1, width=4.6, height=2.6)
    style, frames = looks(arms), []
    for arm in arms:
        curve = bootstrap.profile(scores[arm], thresholds)
        low = high = np.full(len(thresholds), np.nan)
        if min(map(len, scores[arm])) >= INTERVAL_SEEDS:
            low, high = bootstrap.profile_interval(scores[arm], thresholds)
            axis.fill_between(thresholds, low, high, color=style[arm].color, alpha=0.13, linewidth=0)
        n = "/".join(str(len(values)) for values in scores[arm])
        axis.plot(
            thresholds, curve, color=style[arm].color, linestyle=style[arm].line, label=f"{actor_name(arm)} (n={n})"
        )
        frames.append(
            pd.DataFrame({"arm": arm, "n": n, "threshold": thresholds, "share": curve, "low": low, "high": high})
        )
    axis.set_xlabel("Normalised score τ")
    axis.set_ylabel("Share of runs with score > τ")
    axis.set_ylim(-0.02, 1.02)
    legend_below(figure, [axis], 2)
    return [Drawing(name, title, caption, figure=figure, data=pd.concat(frames, ignore_index=True))]
