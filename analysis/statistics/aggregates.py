"""Aggregates over tasks of normalised scores (Agarwal et al. 2021): IQM, median, mean, optimality gap, with
intervals.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from analysis import bootstrap
from analysis.cells import Cell, select
from analysis.names import actor_name, algorithm_name, ordered_arms, task_name
from analysis.references import normalised, references, scale
from analysis.tables import Column, Table, pair, text
from analysis.tests_of_claims import MINIMUM_SEEDS

METRICS = {
    "iqm": ("IQM", bootstrap.iqm),
    "median": ("Median", bootstrap.median),
    "mean": ("Mean", bootstrap.mean),
    "optimality_gap": ("Optimality gap", bootstrap.optimality_gap),
}


def tasks_of(cells: list[Cell], algo: str) -> list[str]:
    """The tasks that aggregates of an algorithm are over: those with a reference and a finished run."""
    return list(dict.fromkeys(cell.env for cell in select(cells, algo) if cell.n and scale(algo, cell.env)))


def scores_of(cells: list[Cell], algo: str, arm: str) -> dict[str, np.ndarray]:
    """Normalised final performance ``[seeds]`` by task."""
    found = [cell for cell in select(cells, algo, arm=arm) if cell.n and scale(algo, cell.env)]
    return {cell.env: normalised(cell.final, algo, cell.env) for cell in found}


def complete_arms(cells: list[Cell], algo: str) -> list[str]:
    """Arms with finished runs on all the tasks of the algorithm: only those can be compared over tasks."""
    tasks = tasks_of(cells, algo)
    return [
        arm
        for arm in ordered_arms({cell.arm for cell in select(cells, algo)})
        if tasks and set(scores_of(cells, algo, arm)) == set(tasks)
    ]


def table(cells: list[Cell]) -> Table:
    """One row per algorithm and arm."""
    rows = []
    for algo in dict.fromkeys(cell.algo for cell in cells):
        tasks = tasks_of(cells, algo)
        for arm in ordered_arms({cell.arm for cell in select(cells, algo)}):
            scores = scores_of(cells, algo, arm)
            if not scores:
                continue
            values = [scores[env] for env in tasks if env in scores]
            lacking = [task_name(env) for env in tasks if env not in scores]
            row: dict[str, Any] = {
                "algo": algo,
                "arm": arm,
                "algorithm": algorithm_name(algo),
                "actor": actor_name(arm),
                "n": " / ".join(str(len(v)) for v in values),
                "tasks": ", ".join(map(task_name, (e for e in tasks if e in scores))),
                "remark": f"not comparable: no finished run on {', '.join(lacking)}" if lacking else "",
            }
            enough = min(map(len, values)) >= MINIMUM_SEEDS
            for key, (_, statistic) in METRICS.items():
                low, high = bootstrap.interval(values, statistic) if enough else (np.nan, np.nan)
                row |= {key: bootstrap.point(values, statistic), f"{key}_low": low, f"{key}_high": high}
                row[f"{key}_shown"] = pair(row[key], low, high, 1)
            rows.append(row)
    columns: list[Column] = [
        ("algorithm", "Algorithm", text),
        ("actor", "Actor", text),
        ("tasks", "Over", text),
        ("n", "n by task", str),
        *((f"{key}_shown", name, str) for key, (name, _) in METRICS.items()),
        ("remark", "Remark", text),
    ]
    sources = references()["aan_reference"]
    caption = (
        "Final performance, normalised: 0 is a uniformly random policy (measured by us, 100 episodes), 100 a "
        "published artificial "
        f"network (TD3: {sources['td3']['source']}. SAC: {sources['sac']['source']}). 95% intervals: stratified "
        f"bootstrap over "
        f"seeds, {bootstrap.REPETITIONS:,} resamples, from {MINIMUM_SEEDS} seeds on. IQM: the middle half of all runs."
    )
    frame = pd.DataFrame(rows) if rows else pd.DataFrame(columns=[key for key, _, _ in columns])
    return Table(
        "aggregates",
        "statistics",
        "Over all tasks",
        caption,
        frame,
        columns,
        "No finished run on a task with a reference score.",
    )
