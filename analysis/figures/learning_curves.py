"""The paper's figures main-td3 and main-sac: average return over training, one panel per task, every actor in each."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from analysis import metrics
from analysis.data.cells import Cell, select
from analysis.data.names import actor_name, algorithm_name, ordered_arms, task_name
from analysis.figures.drawing import Drawing
from analysis.figures.facets import facets
from analysis.figures.view import View
from analysis.style import (
    ArmStyle,
    arm_styles,
    leftmost,
    legend_below,
    lowest,
    panel_grid,
    panels,
    step_axis,
    svg_dashes,
)


def draw(view: View) -> list[Drawing]:
    """``main-<algo>``: all arms in every panel; where they are many, a row of panels per group, baselines in each."""
    name, title = f"main-{view.algo}", f"Average return, {algorithm_name(view.algo)}"
    cells = [cell for cell in view.here if len(cell.all_evaluations)]
    if not cells:
        return [Drawing(name, title, "", missing="No run has been evaluated yet.")]
    tasks = list(dict.fromkeys(cell.env for cell in cells))
    arms = ordered_arms({cell.arm for cell in cells})
    groups = facets(arms, view.claims)
    curves = {(cell.env, cell.arm): curve_of(cell) for cell in cells}
    styles = arm_styles(arms)
    if len(groups) == 1:
        figure, axes = panels(view.style, len(tasks), width=2.8 if len(tasks) < 3 else 2.35)
    else:
        figure, axes = panel_grid(view.style, len(groups), len(tasks), height=1.75)
    panel_keys = [(group, env) for group in groups for env in tasks]
    for index, (axis, (group, env)) in enumerate(zip(axes, panel_keys)):
        here = [cell for cell in select(cells, env=env) if cell.arm in group]
        for cell in here:
            _plot(axis, curves[env, cell.arm], styles[cell.arm], _label(cell.arm, tasks, curves))
        step_axis(axis, max(cell.training_steps for cell in select(cells, env=env)), named=axis in lowest(axes))
        if index < len(tasks):
            axis.set_title(task_name(env))
    for axis in leftmost(axes):
        axis.set_ylabel("Average return")
    legend_below(figure, axes)
    drawn = [(cell, curves[cell.env, cell.arm]) for cell in cells]
    frame = pd.concat([curve.assign(env=cell.env, arm=cell.arm) for cell, curve in drawn], ignore_index=True)
    payload = _payload(cells, curves, styles, groups[0])
    return [Drawing(name, title, _caption(curves, groups), figure=figure, data=frame, alt=_alt(drawn), curves=payload)]


def curve_of(cell: Cell) -> pd.DataFrame:
    """What is drawn of a cell, by step: mean, half standard deviation, both smoothed, and n."""
    steps, returns, _ = metrics.seed_matrix(cell.all_evaluations)
    curve = metrics.mean_curve(returns)
    half = metrics.half_std(returns)
    window = metrics.smoothing_window(len(steps))
    smoothed = metrics.smooth(curve.mean, window)
    return pd.DataFrame(
        {
            "step": steps,
            "n": curve.n,
            "mean": curve.mean,
            "half_std": half,
            "window": window,
            "mean_smoothed": smoothed,
            "half_std_smoothed": np.where(np.isnan(half), np.nan, metrics.smooth(half, window)),
        }
    )


def _caption(curves: dict[tuple[str, str], pd.DataFrame], groups: list[list[str]]) -> str:
    windows = sorted({(int(curve["window"].iloc[0]), len(curve)) for curve in curves.values()})
    shown = ", ".join(f"{window} of {count}" for window, count in windows[:3]) + (", …" if len(windows) > 3 else "")
    facet = f" The actors stand in {len(groups)} rows of panels, the baselines in each." if len(groups) > 1 else ""
    return (
        "Mean over seeds of the evaluation return, smoothed for display by a centred moving average over "
        f"{shown} evaluations; faint: the raw mean; shaded: half a standard deviation over seeds (ddof=1). "
        f"n: seeds.{facet} The window is shortened on both sides alike at the edges. Unfinished runs are drawn as far "
        "as they went; a thin line marks steps with fewer seeds than n. A diverged run's last value is carried forward."
    )


def _plot(axis: Axes, curve: pd.DataFrame, style: ArmStyle, label: str) -> None:
    step, smoothed = curve["step"], curve["mean_smoothed"]
    full = curve["n"] == curve["n"].max()
    axis.plot(step, curve["mean"], color=style.color, linewidth=0.5, alpha=0.35)
    axis.plot(step, smoothed, color=style.color, linestyle=style.line, linewidth=0.6)
    if len(curve) == 1:  # a line of one point is not seen
        axis.plot(step, smoothed, color=style.color, marker=style.marker, markersize=4, clip_on=False)
    axis.plot(step, smoothed.where(full), color=style.color, linestyle=style.line, label=label)
    low, high = (smoothed + sign * curve["half_std_smoothed"] for sign in (-1, 1))
    axis.fill_between(step, low, high, color=style.color, alpha=0.13, linewidth=0)


def _label(arm: str, tasks: list[str], curves: dict[tuple[str, str], pd.DataFrame]) -> str:
    """The actor and its numbers of seeds, by panel where they differ: ``AAN (n=10)``, ``AAN (n=10/9/–)``."""
    counts = [_n(curves[env, arm]) if (env, arm) in curves else "–" for env in tasks]
    return f"{actor_name(arm)} (n={counts[0] if len(set(counts)) == 1 else '/'.join(counts)})"


def _n(curve: pd.DataFrame) -> str:
    low, high = int(curve["n"].min()), int(curve["n"].max())
    return str(high) if low == high else f"{low}–{high}"


def _alt(drawn: list[tuple[Cell, pd.DataFrame]]) -> str:
    """Where each curve ends, by task."""
    words = []
    for env in dict.fromkeys(cell.env for cell, _ in drawn):
        ends = [
            f"{actor_name(cell.arm)} {curve['mean_smoothed'].iloc[-1]:,.0f} at step {int(curve['step'].iloc[-1]):,}"
            for cell, curve in drawn
            if cell.env == env
        ]
        words.append(f"{task_name(env)}: {', '.join(ends)}")
    return f"Learning curves end at: {'; '.join(words)}."


def _payload(
    cells: list[Cell], curves: dict[tuple[str, str], pd.DataFrame], styles: dict[str, ArmStyle], first: list[str]
) -> dict[str, Any]:
    """The same curves and each seed's own for the page's script, to five significant digits; NaN as null."""
    arms = [
        {"arm": arm, "name": actor_name(arm), "color": style.color, "dash": svg_dashes(style.line)}
        for arm, style in styles.items()
    ]
    tasks = []
    for env in dict.fromkeys(cell.env for cell in cells):
        here = select(cells, env=env)
        lines = []
        for cell in here:
            curve = curves[env, cell.arm]
            half = curve["half_std_smoothed"]
            steps, returns, _ = metrics.seed_matrix(cell.all_evaluations)
            own = [(steps[~np.isnan(seed)].tolist(), _digits(seed[~np.isnan(seed)])) for seed in returns]
            lines.append(
                next(arm for arm in arms if arm["arm"] == cell.arm)
                | {
                    "steps": steps.tolist(),
                    "mean": _digits(curve["mean"]),
                    "smooth": _digits(curve["mean_smoothed"]),
                    "low": _digits(curve["mean_smoothed"] - half),
                    "high": _digits(curve["mean_smoothed"] + half),
                    "seeds": own,
                }
            )
        tasks.append({"label": task_name(env), "horizon": max(cell.training_steps for cell in here), "arms": lines})
    return {"arms": arms, "first": first, "tasks": tasks}


def _digits(values: Any) -> list[float | None]:
    return [None if value != value else float(f"{value:.5g}") for value in values]
