"""Sample efficiency: the IQM of normalised returns over tasks as training goes on, with its 95% interval."""

from __future__ import annotations

import numpy as np
import pandas as pd

from analysis import bootstrap
from analysis.claims_file import Claims
from analysis.data.cells import Cell, select
from analysis.data.names import actor_name, algorithm_name, task_name
from analysis.data.study import Study
from analysis.figures.drawing import Drawing
from analysis.hypothesis_tests import INTERVAL_SEEDS
from analysis.references import normalised
from analysis.statistics.aggregates import complete_arms, left_out, tasks_of
from analysis.style import legend_below, looks, panels, step_axis


def draw(study: Study, cells: list[Cell], algo: str, claims: Claims) -> list[Drawing]:
    """``efficiency-<algo>``: not smoothed; only steps at which every counted run of the arm was evaluated."""
    name, title = f"efficiency-{algo}", f"Sample efficiency, {algorithm_name(algo)}"
    tasks, arms = tasks_of(cells, algo, claims), complete_arms(cells, algo, claims)
    caption = (
        f"Interquartile mean of normalised evaluation returns over {', '.join(map(task_name, tasks)) or 'no task'} by "
        "step; shaded: 95% stratified bootstrap interval over seeds (from three seeds on). "
        f"{bootstrap.FEW_SEEDS} {bootstrap.IQM} Not smoothed. Finished runs and diverged ones; only "
        f"steps at "
        "which all of an actor's runs were evaluated." + left_out(cells, algo, claims)
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
    figure, (axis,) = panels(1, width=4.6, height=2.6)
    style, frames, training_steps = looks(arms), [], 0
    for arm in arms:
        found = [select(cells, algo, env, arm)[0] for env in tasks]
        shared = [cell.steps[~np.isnan(cell.returns).any(axis=0)] for cell in found]
        steps = sorted(set(shared[0]).intersection(*shared[1:]))
        if not steps:
            continue
        scores = [normalised(cells, cell.returns[:, np.isin(cell.steps, steps)], algo, cell.env) for cell in found]
        enough = min(cell.n for cell in found) >= INTERVAL_SEEDS
        values, low, high = bootstrap.curve_interval(scores, bootstrap.iqm)
        if not enough:
            low = high = np.full(len(values), np.nan)
        n, training_steps = (
            "/".join(str(cell.n) for cell in found),
            max([training_steps, *(cell.training_steps for cell in found)]),
        )
        axis.fill_between(steps, low, high, color=style[arm].color, alpha=0.15, linewidth=0)
        axis.plot(steps, values, color=style[arm].color, linestyle=style[arm].line, label=f"{actor_name(arm)} (n={n})")
        frames.append(pd.DataFrame({"arm": arm, "n": n, "step": steps, "iqm": values, "low": low, "high": high}))
    if not frames:
        return [Drawing(name, title, caption, missing="No step at which all runs of an actor were evaluated.")]
    step_axis(axis, training_steps)
    axis.set_ylabel("IQM of normalised scores")
    legend_below(figure, [axis], 2)
    return [Drawing(name, title, caption, figure=figure, data=pd.concat(frames, ignore_index=True))]
