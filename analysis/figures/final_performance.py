"""Final performance per task, every seed a point."""

from __future__ import annotations

import numpy as np
import pandas as pd

from analysis.coverage import covers
from analysis.data.cells import select
from analysis.data.names import actor_name, algorithm_name, ordered_arms, task_name
from analysis.figures.drawing import Drawing
from analysis.figures.view import View
from analysis.hypothesis_tests import INTERVAL_SEEDS, t_interval
from analysis.style import arm_styles, lowest, panels


def draw(view: View) -> list[Drawing]:
    """``final-<algo>``: seeds as points, the mean as a bar, its 95% t interval where there are seeds enough."""
    name, title = f"final-{view.algo}", f"Final performance by seed, {algorithm_name(view.algo)}"
    caption = (
        "Each point is a run: the mean of its evaluations in the last 10% of its steps. Vertical bar: mean over seeds; "
        f"line: its 95% t interval (from {INTERVAL_SEEDS} seeds on). Crosses: diverged runs, their last value carried "
        f"forward. {covers('mean')}"
    )
    here = [cell for cell in view.here if cell.n]
    if not here:
        return [Drawing(name, title, caption, missing=f"No finished run under {algorithm_name(view.algo)}.")]
    tasks, arms = list(dict.fromkeys(cell.env for cell in here)), ordered_arms({cell.arm for cell in here})
    styles = arm_styles(arms)
    figure, axes = panels(view.style, len(tasks), width=3.4, height=0.75 + 0.24 * len(arms), columns=2)
    rows = []
    for axis, env in zip(axes, tasks):
        shown = select(here, env=env)
        for position, cell in enumerate(shown):
            style = styles[cell.arm]
            low, high = t_interval(cell.final)
            offsets = np.linspace(-0.2, 0.2, cell.n) if cell.n > 1 else np.zeros(1)
            ok = ~cell.diverged
            axis.scatter(
                cell.final[ok],
                position + offsets[ok],
                s=14,
                marker=style.marker,
                color=style.color,
                alpha=0.75,
                linewidth=0,
            )
            axis.scatter(cell.final[~ok], position + offsets[~ok], s=18, marker="x", color=style.color, linewidth=1)
            axis.plot([low, high], [position, position], color="black", linewidth=1)
            axis.plot([cell.final.mean()] * 2, [position - 0.3, position + 0.3], color="black", linewidth=1.6)
            rows += [
                {
                    "env": env,
                    "arm": cell.arm,
                    "seed": int(seed),
                    "final": float(value),
                    "diverged": bool(bad),
                    "mean": float(cell.final.mean()),
                    "mean_low": low,
                    "mean_high": high,
                }
                for seed, value, bad in zip(cell.seeds, cell.final, cell.diverged)
            ]
        axis.set_yticks(range(len(shown)), [f"{actor_name(cell.arm)} (n={cell.n})" for cell in shown])
        axis.set_ylim(len(shown) - 0.5, -0.5)
        axis.set_title(task_name(env))
        axis.grid(False, axis="y")
    for axis in lowest(axes):
        axis.set_xlabel("Final performance (return)")
    many = len(tasks) > 2 or view.study.runs["algo"].nunique() > 1  # the first table says the same in less room
    alt = "Final performance, mean and range over seeds: " + "; ".join(
        f"{task_name(env)}: "
        + ", ".join(
            f"{actor_name(cell.arm)} {cell.final.mean():,.0f} ({cell.final.min():,.0f} to {cell.final.max():,.0f})"
            for cell in select(here, env=env)
        )
        for env in tasks
    )
    return [Drawing(name, title, caption, figure=figure, data=pd.DataFrame(rows), alt=f"{alt}.", folded=many)]
