"""Sample efficiency: the IQM of normalised returns over tasks as training goes on, with its 95% interval."""

from __future__ import annotations

import numpy as np
import pandas as pd

from analysis import bootstrap
from analysis.coverage import covers
from analysis.data.cells import select
from analysis.data.names import actor_name, algorithm_name
from analysis.figures.drawing import Drawing
from analysis.figures.over_tasks import arms_and_tasks, none, tasks_in_words, those_left_out
from analysis.figures.view import View
from analysis.hypothesis_tests import INTERVAL_SEEDS
from analysis.references import scale
from analysis.style import arm_styles, legend_below, panels, step_axis


def draw(view: View) -> list[Drawing]:
    """``efficiency-<algo>``: not smoothed; only steps at which every counted run of the arm was evaluated."""
    name, title = f"efficiency-{view.algo}", f"Sample efficiency, {algorithm_name(view.algo)}"
    arms, tasks = arms_and_tasks(view)
    caption = (
        f"Interquartile mean of normalised evaluation returns over {tasks_in_words(tasks)} by step, not smoothed; "
        f"shaded: 95% stratified bootstrap interval over seeds (from {INTERVAL_SEEDS} seeds on). "
        f"{covers('iqm')} {bootstrap.IQM} Finished and diverged runs; only steps at which all of an actor's runs were "
        "evaluated." + those_left_out(view)
    )
    if not arms:
        return none(name, title, caption, view)
    figure, (axis,) = panels(view.style, 1, width=4.6, height=2.4)
    styles, frames, longest = arm_styles(arms), [], 0
    for arm in arms:
        found = [select(view.cells, view.algo, env, arm)[0] for env in tasks]
        shared = [cell.steps[~np.isnan(cell.returns).any(axis=0)] for cell in found]
        steps = sorted(set(shared[0]).intersection(*shared[1:]))
        if not steps:
            continue
        scales = [scale(view.cells, view.algo, env, view.claims) for env in tasks]
        scores = [s.normalised(c.returns[:, np.isin(c.steps, steps)]) for s, c in zip(scales, found) if s]
        enough = min(cell.n for cell in found) >= INTERVAL_SEEDS
        values, low, high = bootstrap.curve_interval(scores, bootstrap.iqm)
        if not enough:
            low = high = np.full(len(values), np.nan)
        n = "/".join(dict.fromkeys(str(cell.n) for cell in found))
        longest = max([longest, *(cell.training_steps for cell in found)])
        axis.fill_between(steps, low, high, color=styles[arm].color, alpha=0.15, linewidth=0)
        axis.plot(
            steps, values, color=styles[arm].color, linestyle=styles[arm].line, label=f"{actor_name(arm)} (n={n})"
        )
        frames.append(pd.DataFrame({"arm": arm, "n": n, "step": steps, "iqm": values, "low": low, "high": high}))
    if not frames:
        missing = "No step at which all runs of an actor were evaluated."
        return [Drawing(name, title, caption, missing=missing, folded=True)]
    step_axis(axis, longest)
    axis.set_ylabel("IQM of normalised scores")
    legend_below(figure, [axis], 2)
    data = pd.concat(frames, ignore_index=True)
    ends = [f"{actor_name(frame['arm'].iloc[0])} {frame['iqm'].iloc[-1]:.1f}" for frame in frames]
    alt = f"Interquartile mean of normalised scores at the last shared step: {', '.join(ends)}."
    return [Drawing(name, title, caption, figure=figure, data=data, alt=alt, folded=True)]
