"""A swept key (lateral radius, time steps, branches, ...): final performance against its value, found from the
labels' changed keys.
"""

from __future__ import annotations

import json

import pandas as pd

from analysis.claims_file import Claims
from analysis.data.cells import Cell, select
from analysis.data.names import actor_name, algorithm_name, task_name
from analysis.data.study import Study, flat_configuration
from analysis.figures.drawing import Drawing
from analysis.hypothesis_tests import t_interval
from analysis.style import looks, panels


def draw(study: Study, cells: list[Cell], algo: str, claims: Claims) -> list[Drawing]:
    """``sweep-<algo>-<key>`` for each key that alone separates variants of an actor; none where nothing was swept."""
    points = _points(study, select(cells, algo))
    return [_drawing(algo, key, points[points["key"] == key]) for key in sorted(points["key"].unique())]


def _points(study: Study, cells: list[Cell]) -> pd.DataFrame:
    """One row per swept key, task, actor, spike coding and value: variants with that key alone changed, and the
    unchanged actor under the same coding.
    """
    rows: list[dict[str, object]] = []
    known = {
        (str(run.algo), str(run.env), str(run.arm)): (
            list(json.loads(str(run.changed_keys))),
            str(run.actor),
            str(run.label),
            str(run.encoder),
        )
        for run in study.runs.itertuples()
    }
    about = [(cell, *known[cell.algo, cell.env, cell.arm]) for cell in cells]
    swept = {(cell.algo, cell.env, actor, coding, keys[0]) for cell, keys, actor, _, coding in about if len(keys) == 1}
    for algo, env, actor, coding, key in sorted(swept):
        for cell, keys, name, label, other in about:
            if (cell.algo, cell.env, name, other) != (algo, env, actor, coding) or not cell.n:
                continue
            value = _value(flat_configuration(study, algo, env, cell.arm), key)
            if (keys and keys != [key]) or (not keys and label != actor) or value is None:
                continue
            low, high = t_interval(cell.final)
            rows.append(
                {
                    "key": key,
                    "env": env,
                    "actor": actor,
                    "coding": coding,
                    "arm": cell.arm,
                    "value": value,
                    "n": cell.n,
                    "mean": float(cell.final.mean()),
                    "low": low,
                    "high": high,
                    "seeds": " ".join(map(repr, cell.final.tolist())),
                }
            )
    names = ["key", "env", "actor", "coding", "arm", "value", "n", "mean", "low", "high", "seeds"]
    frame = pd.DataFrame(rows, columns=names)
    if frame.empty:
        return frame
    line = ["key", "env", "actor", "coding"]
    distinct = frame.groupby(line)["value"].transform("nunique")
    return frame[distinct > 1].sort_values([*line, "value"]).reset_index(drop=True)


def _value(flat: dict[str, object], key: str) -> float | None:
    """The key's value as a number; the key may or may not carry its group's name."""
    for name in (key, f"actor.{key}", f"encoder.{key}", f"algo.{key}"):
        value = flat.get(name)
        if isinstance(value, (int, float)) and not isinstance(value, bool):
            return float(value)
    return None


def _lines(points: pd.DataFrame) -> pd.Series:
    """One line per actor, and per spike coding where one actor was swept under several."""
    codings = points.groupby("actor")["coding"].transform("nunique")
    return points["actor"].where(codings == 1, points["actor"] + " [" + points["coding"] + "]")


def _drawing(algo: str, key: str, points: pd.DataFrame) -> Drawing:
    points = points.assign(line=_lines(points))
    tasks, lines = list(dict.fromkeys(points["env"])), list(dict.fromkeys(points["line"]))
    style = looks(lines)
    figure, axes = panels(len(tasks), width=2.6)
    for axis, env in zip(axes, tasks):
        for line in lines:
            mine = points[(points["env"] == env) & (points["line"] == line)]
            look = style[line]
            axis.plot(
                mine["value"],
                mine["mean"],
                color=look.color,
                linestyle=look.line,
                marker=look.marker,
                markersize=4,
                label=actor_name(line),
            )
            axis.vlines(mine["value"], mine["low"], mine["high"], color=look.color, linewidth=1)
            for row in mine.itertuples():
                seeds = [float(value) for value in str(row.seeds).split()]
                axis.scatter([row.value] * len(seeds), seeds, s=5, color=look.color, alpha=0.4, linewidth=0)
        axis.set_xticks(sorted(points.loc[points["env"] == env, "value"].unique()))
        axis.xaxis.set_major_formatter("{x:g}")
        axis.set_xlabel(key)
        n = sorted(points.loc[points["env"] == env, "n"].unique())
        axis.set_title(f"{task_name(env)} (n={n[0]}{'' if len(n) == 1 else f'–{n[-1]}'} each)", fontsize=8)
        axis.margins(x=0.08)
    axes[0].set_ylabel("Final performance")
    if len(lines) > 1:
        figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    caption = (
        f"Final performance against {key}: mean over seeds, its 95% t interval (from three seeds on), and "
        f"the seeds. Runs in which only "
        "this key was changed, and the unchanged actor at its own value; a line per actor and spike coding."
    )
    return Drawing(
        f"sweep-{algo}-{key}", f"Return against {key}, {algorithm_name(algo)}", caption, figure=figure, data=points
    )
