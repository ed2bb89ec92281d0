"""A swept key (lateral radius, time steps, branches, ...): final performance against its value, found from the
labels' changed keys.
"""

from __future__ import annotations

import json

import numpy as np
import pandas as pd

from analysis import bootstrap
from analysis.cells import Cell, select
from analysis.figures.drawing import Drawing
from analysis.names import actor_name, algorithm_name, task_name
from analysis.study import Study, flat_configuration
from analysis.style import looks, panels
from analysis.tests_of_claims import MINIMUM_SEEDS


def draw(study: Study, cells: list[Cell], algo: str) -> list[Drawing]:
    """``sweep-<algo>-<key>`` for each key that alone separates variants of an actor; none where nothing was swept."""
    points = _points(study, select(cells, algo))
    return [_drawing(algo, key, points[points["key"] == key]) for key in sorted(points["key"].unique())]


def _points(study: Study, cells: list[Cell]) -> pd.DataFrame:
    """One row per swept key, task, actor and value: variants with that key alone changed, and the unchanged actor."""
    runs, rows = study.runs, []
    changed = {
        (run.algo, run.env, run.arm): (json.loads(str(run.changed_keys)), run.actor, run.encoder)
        for run in runs.itertuples()
    }
    swept = {
        (
            cell.algo,
            cell.env,
            changed[cell.algo, cell.env, cell.arm][1],
            next(iter(changed[cell.algo, cell.env, cell.arm][0])),
        )
        for cell in cells
        if len(changed[cell.algo, cell.env, cell.arm][0]) == 1
    }
    for algo, env, actor, key in sorted(swept):
        for cell in select(cells, algo, env):
            keys, name, _ = changed[algo, env, cell.arm]
            if str(name) != str(actor) or not cell.n or (keys and list(keys) != [key]) or (not keys and not cell.paper):
                continue
            value = _value(flat_configuration(study, algo, env, cell.arm), key)
            if value is None:
                continue
            low, high = (
                bootstrap.interval([cell.final], bootstrap.mean) if cell.n >= MINIMUM_SEEDS else (np.nan, np.nan)
            )
            rows.append(
                {
                    "key": key,
                    "env": env,
                    "actor": actor,
                    "arm": cell.arm,
                    "value": value,
                    "n": cell.n,
                    "mean": float(cell.final.mean()),
                    "low": low,
                    "high": high,
                    "seeds": " ".join(map(repr, cell.final.tolist())),
                }
            )
    frame = pd.DataFrame(rows, columns=["key", "env", "actor", "arm", "value", "n", "mean", "low", "high", "seeds"])
    distinct = (
        frame.groupby(["key", "env", "actor"])["value"].transform("nunique") if len(frame) else pd.Series(dtype=int)
    )
    return (
        frame[distinct > 1].sort_values(["key", "env", "actor", "value"]).reset_index(drop=True)
        if len(frame)
        else frame
    )


def _value(flat: dict[str, object], key: str) -> float | None:
    """The key's value as a number; the key may or may not carry its group's name."""
    for name in (key, f"actor.{key}", f"encoder.{key}", f"algo.{key}"):
        value = flat.get(name)
        if isinstance(value, (int, float)) and not isinstance(value, bool):
            return float(value)
    return None


def _drawing(algo: str, key: str, points: pd.DataFrame) -> Drawing:
    tasks, actors = list(dict.fromkeys(points["env"])), list(dict.fromkeys(points["actor"]))
    style = looks(actors)
    figure, axes = panels(len(tasks), width=2.6)
    for axis, env in zip(axes, tasks):
        for actor in actors:
            mine = points[(points["env"] == env) & (points["actor"] == actor)]
            look = style[actor]
            axis.plot(
                mine["value"],
                mine["mean"],
                color=look.color,
                linestyle=look.line,
                marker=look.marker,
                markersize=4,
                label=actor_name(actor),
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
    if len(actors) > 1:
        figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    caption = (
        f"Final performance against {key}: mean over seeds, its 95% bootstrap interval (from three seeds on), and "
        f"the seeds. Runs in which only "
        "this key was changed, and the unchanged actor at its own value."
    )
    return Drawing(
        f"sweep-{algo}-{key}", f"Return against {key}, {algorithm_name(algo)}", caption, figure=figure, data=points
    )
