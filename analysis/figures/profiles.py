"""Performance profiles (Agarwal et al. 2021): the share of runs that score above each threshold."""

from __future__ import annotations

import numpy as np
import pandas as pd

from analysis import bootstrap
from analysis.coverage import covers
from analysis.data.names import actor_name, algorithm_name
from analysis.figures.drawing import Drawing
from analysis.figures.over_tasks import arms_and_tasks, none, tasks_in_words, those_left_out
from analysis.figures.view import View
from analysis.hypothesis_tests import INTERVAL_SEEDS
from analysis.statistics.aggregates import scores_of
from analysis.style import arm_styles, legend_below, panels


def draw(view: View) -> list[Drawing]:
    """``profile-<algo>`` over normalised final performance."""
    name, title = f"profile-{view.algo}", f"Performance profile, {algorithm_name(view.algo)}"
    arms, tasks = arms_and_tasks(view)
    caption = (
        f"Share of runs whose normalised final performance exceeds a threshold, over {tasks_in_words(tasks)}, tasks "
        "weighing the same; a curve above another at every threshold is better everywhere. Shaded: pointwise 95% "
        f"stratified bootstrap interval (from {INTERVAL_SEEDS} seeds on). {covers('profile')}" + those_left_out(view)
    )
    if not arms:
        return none(name, title, caption, view)
    scores = {arm: [scores_of(view.cells, view.algo, arm, view.claims)[env] for env in tasks] for arm in arms}
    every = np.concatenate([values for arm in arms for values in scores[arm]])
    thresholds = np.linspace(min(0.0, float(np.floor(every.min()))), max(float(np.ceil(every.max())), 10.0), 101)
    figure, (axis,) = panels(view.style, 1, width=4.6, height=2.4)
    styles, frames = arm_styles(arms), []
    for arm in arms:
        curve = bootstrap.profile(scores[arm], thresholds)
        low = high = np.full(len(thresholds), np.nan)
        if min(map(len, scores[arm])) >= INTERVAL_SEEDS:
            low, high = bootstrap.profile_interval(scores[arm], thresholds)
            axis.fill_between(thresholds, low, high, color=styles[arm].color, alpha=0.13, linewidth=0)
        n = "/".join(dict.fromkeys(str(len(values)) for values in scores[arm]))
        axis.plot(
            thresholds, curve, color=styles[arm].color, linestyle=styles[arm].line, label=f"{actor_name(arm)} (n={n})"
        )
        frames.append(
            pd.DataFrame({"arm": arm, "n": n, "threshold": thresholds, "share": curve, "low": low, "high": high})
        )
    axis.set_xlabel("Normalised score τ")
    axis.set_ylabel("Share of runs with score > τ")
    axis.set_ylim(-0.02, 1.02)
    legend_below(figure, [axis], 2)
    data = pd.concat(frames, ignore_index=True)
    halves = [f"{actor_name(arm)} {np.median(np.concatenate(scores[arm])):.1f}" for arm in arms]
    alt = f"Median normalised score of the runs, where a profile crosses one half: {', '.join(halves)}."
    return [Drawing(name, title, caption, figure=figure, data=data, alt=alt, folded=True)]
