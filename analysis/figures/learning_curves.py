"""The paper's figures main-td3 and main-sac: average return over training, one panel per task."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from analysis import metrics
from analysis.claims_file import Claims
from analysis.data.cells import Cell, select
from analysis.data.names import actor_name, algorithm_name, task_name
from analysis.data.study import Study
from analysis.figures.drawing import Drawing
from analysis.style import Look, legend_below, looks, panels, step_axis

MAIN = ("aan", "popsan", "bptsan")


def draw(study: Study, cells: list[Cell], algo: str, claims: Claims) -> list[Drawing]:
    """``main-<algo>`` with the paper's three actors, and ``others-<algo>`` with all further arms beside BPT-SAN."""
    here = select(cells, algo)
    main = [cell for cell in here if cell.arm in MAIN]
    others = [cell for cell in here if cell.arm not in MAIN]
    title = f"Average return, {algorithm_name(algo)}"
    drawings = [_drawing(f"main-{algo}", f"{title}: AAN, regular SAN, BPT-SAN", main)]
    if others:
        beside = [cell for cell in here if cell.arm not in ("aan", "popsan")]
        drawings.append(_drawing(f"others-{algo}", f"{title}: ablations and variants beside BPT-SAN", beside))
    return drawings


def curve_of(cell: Cell, window: int = metrics.SMOOTHING_WINDOW) -> pd.DataFrame:
    """What is drawn of a cell, by step: mean, half standard deviation, both smoothed, and n."""
    steps, returns, _ = metrics.seed_matrix(cell.all_evaluations)
    curve = metrics.mean_curve(returns)
    half = metrics.half_std(returns)
    smoothed = metrics.smooth(curve.mean, window)
    return pd.DataFrame(
        {
            "step": steps,
            "n": curve.n,
            "mean": curve.mean,
            "half_std": half,
            "mean_smoothed": smoothed,
            "half_std_smoothed": np.where(np.isnan(half), np.nan, metrics.smooth(half, window)),
        }
    )


def _drawing(name: str, title: str, cells: list[Cell]) -> Drawing:
    caption = (
        "Mean over seeds of the evaluation return; shaded: half a standard deviation over seeds (ddof=1, none for a "
        f"single seed). Smoothed for display with a centred moving average over {metrics.SMOOTHING_WINDOW} "
        f"evaluations, "
        "shortened on both sides alike at the edges. n: seeds, by panel where they differ, a range where they differ "
        "by "
        "step. Unfinished runs are drawn as far as they went; a thin line marks steps with fewer seeds than n. A "
        "diverged "
        "run's last value is carried forward."
    )
    cells = [cell for cell in cells if len(cell.all_evaluations)]
    if not cells:
        wanted = ", ".join(map(actor_name, MAIN))
        return Drawing(name, title, caption, missing=f"No run of {wanted} has been evaluated yet.")
    tasks = list(dict.fromkeys(cell.env for cell in cells))
    style = looks(list(dict.fromkeys(cell.arm for cell in cells)))
    figure, axes = panels(len(tasks))
    frames = []
    curves = {(cell.env, cell.arm): curve_of(cell) for cell in cells}
    for axis, env in zip(axes, tasks):
        for cell in select(cells, env=env):
            curve = curves[env, cell.arm]
            frames.append(curve.assign(env=env, arm=cell.arm))
            _plot(axis, curve, style[cell.arm], _label(cell.arm, tasks, curves))
        step_axis(axis, max(cell.training_steps for cell in select(cells, env=env)))
        axis.set_title(task_name(env))
    for axis in axes[:: min(len(axes), 4)]:
        axis.set_ylabel("Average return")
    legend_below(figure, axes)
    return Drawing(name, title, caption, figure=figure, data=pd.concat(frames, ignore_index=True))


def _plot(axis: Axes, curve: pd.DataFrame, look: Look, label: str) -> None:
    most = curve["n"].max()
    full = curve["n"] == most
    axis.plot(curve["step"], curve["mean_smoothed"], color=look.color, linestyle=look.line, linewidth=0.6)
    if len(curve) == 1:  # a line of one point is not seen
        axis.plot(
            curve["step"], curve["mean_smoothed"], color=look.color, marker=look.marker, markersize=4, clip_on=False
        )
    whole = curve["mean_smoothed"].where(full)
    axis.plot(curve["step"], whole, color=look.color, linestyle=look.line, label=label)
    low, high = (curve["mean_smoothed"] + sign * curve["half_std_smoothed"] for sign in (-1, 1))
    axis.fill_between(curve["step"], low, high, color=look.color, alpha=0.15, linewidth=0)


def _label(arm: str, tasks: list[str], curves: dict[tuple[str, str], pd.DataFrame]) -> str:
    """The actor and its numbers of seeds, by panel where they differ: ``AAN (n=10)``, ``AAN (n=10/9/–)``."""
    counts = [_n(curves[env, arm]) if (env, arm) in curves else "–" for env in tasks]
    return f"{actor_name(arm)} (n={counts[0] if len(set(counts)) == 1 else '/'.join(counts)})"


def _n(curve: pd.DataFrame) -> str:
    low, high = int(curve["n"].min()), int(curve["n"].max())
    return str(high) if low == high else f"{low}–{high}"
