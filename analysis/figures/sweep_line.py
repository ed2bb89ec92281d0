"""A swept key (lateral radius, time steps, branches, steps of training, ...): final performance against its value."""

from __future__ import annotations

from typing import Any

import pandas as pd

from analysis.coverage import covers
from analysis.data.names import algorithm_name, ordered_tasks, task_name
from analysis.figures.drawing import Drawing
from analysis.figures.swept import ordered_values, runs_by, swept_keys
from analysis.figures.view import View
from analysis.hypothesis_tests import INTERVAL_SEEDS, t_interval
from analysis.style import arm_styles, leftmost, legend_below, lowest, panels


def draw(view: View) -> list[Drawing]:
    """``sweep-<algo>-<key>`` for each key of ``--by``, else for each key that alone separates variants of an actor."""
    found = {key: _points(view, key) for key in view.by or swept_keys(view.study, view.algo)}
    drawings = [_drawing(view, key, points) for key, points in found.items() if not points.empty]
    for key in view.by:
        if found[key].empty:
            title = f"Return against {key}, {algorithm_name(view.algo)}"
            missing = f"No actor has finished runs with two values of {key}."
            drawings.append(Drawing(f"sweep-{view.algo}-{key}", title, "", missing=missing, folded=True))
    return drawings


def _points(view: View, key: str) -> pd.DataFrame:
    """A row per task, line and value; lines with one value only are left out."""
    runs = runs_by(view.study, view.algo, (key,))
    if runs.empty:
        return runs
    runs = runs.assign(value=[value[0] for value in runs["value"]])
    rows: list[dict[str, Any]] = []
    order = {value: position for position, value in enumerate(ordered_values(runs["value"]))}
    for (env, line), mine in runs.groupby(["env", "line"], sort=True):
        if mine["value"].nunique() < 2:
            continue
        for value, group in sorted(mine.groupby("value"), key=lambda item: order[item[0]]):
            finals = group["final"].to_numpy(dtype=float)
            low, high = t_interval(finals)
            seeds = " ".join(map(repr, finals.tolist()))
            rows.append(
                {"key": key, "env": env, "line": line, "value": value, "position": order[value], "n": len(finals),
                 "mean": float(finals.mean()), "low": low, "high": high, "seeds": seeds}
            )  # fmt: skip
    return pd.DataFrame(rows)


def _groups(points: pd.DataFrame) -> list[tuple[str, str, pd.DataFrame]]:
    pairs = dict.fromkeys(zip(points["env"], points["line"]))
    return [(env, line, points[(points["env"] == env) & (points["line"] == line)]) for env, line in pairs]


def _drawing(view: View, key: str, points: pd.DataFrame) -> Drawing:
    tasks, lines = ordered_tasks(points["env"]), list(dict.fromkeys(points["line"]))
    styles = arm_styles(lines)
    numeric = points["value"].map(lambda value: isinstance(value, (int, float))).all()
    figure, axes = panels(view.style, len(tasks), width=2.6)
    for axis, env in zip(axes, tasks):
        here = points[points["env"] == env]
        for line in lines:
            mine, style = here[here["line"] == line], styles[line]
            x = mine["value"] if numeric else mine["position"]
            axis.plot(
                x, mine["mean"], color=style.color, linestyle=style.line, marker=style.marker, markersize=4, label=line
            )
            axis.vlines(x, mine["low"], mine["high"], color=style.color, linewidth=1)
            for position, seeds in zip(x, mine["seeds"]):
                values = [float(value) for value in str(seeds).split()]
                axis.scatter([position] * len(values), values, s=5, color=style.color, alpha=0.4, linewidth=0)
        if numeric:
            axis.set_xticks(sorted(here["value"].unique()))
            axis.xaxis.set_major_formatter("{x:g}")
        else:
            named = here.drop_duplicates("position").sort_values("position")
            axis.set_xticks(named["position"], [str(value) for value in named["value"]])
        n = sorted(here["n"].unique())
        axis.set_title(f"{task_name(env)} (n={n[0]}{'' if len(n) == 1 else f'–{n[-1]}'} each)", fontsize=8)
        axis.margins(x=0.08)
    for axis in lowest(axes):
        axis.set_xlabel(key)
    for axis in leftmost(axes):
        axis.set_ylabel("Final performance")
    if len(lines) > 1:
        legend_below(figure, axes)
    caption = (
        f"Final performance against {key}: mean over seeds, its 95% t interval (from {INTERVAL_SEEDS} seeds on), and "
        f"the seeds; a line per actor and for what else was changed in it. {covers('mean')}"
    )
    title = f"Return against {key}, {algorithm_name(view.algo)}"
    ends = [
        f"{task_name(env)}, {line}: "
        + ", ".join(f"{mean:,.0f} at {value}" for value, mean in zip(group["value"], group["mean"]))
        for env, line, group in _groups(points)
    ]
    alt = f"Final performance against {key}: {'; '.join(ends)}."
    return Drawing(f"sweep-{view.algo}-{key}", title, caption, figure=figure, data=points, alt=alt, folded=not view.by)
