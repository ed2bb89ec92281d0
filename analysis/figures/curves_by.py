"""Learning curves coloured by the value of a key (``--by``): a row of panels per actor, the baselines in each."""

from __future__ import annotations

import textwrap

import numpy as np
import pandas as pd
from matplotlib import colormaps

from analysis import metrics
from analysis.data.cells import select
from analysis.data.names import actor_name, algorithm_name, ordered_tasks, task_name
from analysis.figures.drawing import Drawing
from analysis.figures.learning_curves import curve_of
from analysis.figures.swept import ordered_values, runs_by
from analysis.figures.view import View
from analysis.style import arm_styles, leftmost, legend_below, lowest, panel_grid, step_axis

MOST_ROWS = 8


def draw(view: View) -> list[Drawing]:
    """``curves-<algo>-<key>`` for each key of ``--by``; none without it."""
    return [drawing for key in view.by for drawing in _drawing(view, key)]


def _drawing(view: View, key: str) -> list[Drawing]:
    runs = runs_by(view.study, view.algo, (key,))
    several = runs.groupby("line")["value"].nunique() if len(runs) else pd.Series(dtype=int)
    lines = [line for line in dict.fromkeys(runs["line"]) if several[line] > 1]
    if not lines:
        return []  # the sweep figure of the same key says so
    tasks, values = ordered_tasks(runs["env"]), ordered_values(runs["value"].map(lambda value: value[0]))
    shades = colormaps["viridis"](np.linspace(0, 0.88, len(values)))
    shown = lines[:MOST_ROWS]
    figure, axes = panel_grid(view.style, len(shown), len(tasks), height=1.75)
    frames = []
    drawn_arms = set(runs.loc[runs["line"].isin(lines), "arm"])
    beside = [arm for arm in view.claims.baselines if arm not in drawn_arms]
    panel_keys = [(line, env) for line in shown for env in tasks]
    for index, (axis, (line, env)) in enumerate(zip(axes, panel_keys)):
        for arm in beside:
            for cell in select(view.here, env=env, arm=arm):
                curve, style = curve_of(cell), arm_styles([arm])[arm]
                axis.plot(
                    curve["step"],
                    curve["mean_smoothed"],
                    color=style.color,
                    linestyle=style.line,
                    label=actor_name(arm),
                )
                frames.append(curve.assign(env=env, line=actor_name(arm), value=""))
        mine = runs[(runs["env"] == env) & (runs["line"] == line)]
        for value, shade in zip(values, shades):
            chosen = mine[mine["value"] == (value,)]
            if chosen.empty:
                continue
            curve = _curve(view, env, chosen)
            axis.plot(curve["step"], curve["mean_smoothed"], color=shade, label=f"{key} = {value}")
            low, high = (curve["mean_smoothed"] + sign * curve["half_std_smoothed"] for sign in (-1, 1))
            axis.fill_between(curve["step"], low, high, color=shade, alpha=0.13, linewidth=0)
            frames.append(curve.assign(env=env, line=line, value=value))
        step_axis(axis, int(runs.loc[runs["env"] == env, "steps"].max()), named=axis in lowest(axes))
        if index < len(tasks):
            axis.set_title(task_name(env))
    for axis, line in zip(leftmost(axes), shown):
        axis.set_ylabel("\n".join(textwrap.wrap(line, 20)), fontsize=7)
    legend_below(figure, axes)
    rest = lines[len(shown) :]
    more = f" {len(rest)} further actors are not drawn: {', '.join(rest)}." if rest else ""
    caption = (
        f"Mean evaluation return (vertical) over seeds by {key}, smoothed as the curves above; shaded: half a standard "
        f"deviation. A row per actor; baselines without this key stand in each panel.{more}"
    )
    title = f"Average return by {key}, {algorithm_name(view.algo)}"
    data = pd.concat(frames, ignore_index=True)
    ends = data.groupby(["env", "line", "value"], sort=False)["mean_smoothed"].last().reset_index()
    alt = f"Curves by {key} end at: " + "; ".join(
        f"{task_name(env)}, {line} {value}: {end:,.0f}"
        for env, line, value, end in zip(ends["env"], ends["line"], ends["value"], ends["mean_smoothed"])
    )
    return [Drawing(f"curves-{view.algo}-{key}", title, caption, figure=figure, data=data, alt=f"{alt}.")]


def _curve(view: View, env: str, chosen: pd.DataFrame) -> pd.DataFrame:
    """The curve of some runs, whatever arms they belong to."""
    table = view.study.evaluations
    table = table[(table["algo"] == view.algo) & (table["env"] == env)].merge(
        chosen[["arm", "seed"]], on=["arm", "seed"]
    )
    table = table.assign(seed=table["arm"].astype(str) + "/" + table["seed"].astype(str))
    steps_by_seed = table.pivot(index="seed", columns="step", values="return").sort_index().sort_index(axis=1)
    steps, returns = steps_by_seed.columns.to_numpy(dtype=np.int64), steps_by_seed.to_numpy(dtype=float)
    curve, half = metrics.mean_curve(returns), metrics.half_std(returns)
    window = metrics.smoothing_window(len(steps))
    return pd.DataFrame(
        {
            "step": steps,
            "n": curve.n,
            "mean": curve.mean,
            "half_std": half,
            "window": window,
            "mean_smoothed": metrics.smooth(curve.mean, window),
            "half_std_smoothed": np.where(np.isnan(half), np.nan, metrics.smooth(half, window)),
        }
    )
