"""Aggregates over tasks of normalised scores (Agarwal et al. 2021): IQM, median, mean, optimality gap, with
intervals.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from analysis import bootstrap
from analysis.claims_file import Claims
from analysis.coverage import AGGREGATES, covers
from analysis.data.cells import Cell, select
from analysis.data.names import actor_name, algorithm_name, ordered, ordered_arms, task_name
from analysis.hypothesis_tests import INTERVAL_SEEDS
from analysis.references import normalised, references, scale
from analysis.tables import Column, Table, pair, text

METRICS = {
    "iqm": ("IQM", bootstrap.iqm),
    "median": ("Median", bootstrap.median),
    "mean": ("Mean", bootstrap.mean),
    "optimality_gap": ("Optimality gap", bootstrap.optimality_gap),
}


def tasks_of(cells: list[Cell], algo: str, claims: Claims) -> list[str]:
    """The tasks that aggregates of an algorithm are over: the claims' that have a reference and a finished run."""
    finished = {cell.env for cell in select(cells, algo) if cell.n and scale(cells, algo, cell.env, claims)}
    return ordered(finished & set(claims.tasks), claims.tasks)


def scores_of(cells: list[Cell], algo: str, arm: str, claims: Claims) -> dict[str, np.ndarray]:
    """Normalised final performance ``[seeds]`` by task."""
    found = [cell for cell in select(cells, algo, arm=arm) if cell.n and scale(cells, algo, cell.env, claims)]
    return {cell.env: normalised(cells, cell.final, algo, cell.env, claims) for cell in found}


def complete_arms(cells: list[Cell], algo: str, claims: Claims) -> list[str]:
    """Arms with finished runs on all the tasks of the algorithm: only those can be compared over tasks."""
    tasks = set(tasks_of(cells, algo, claims))
    arms = ordered_arms({cell.arm for cell in select(cells, algo)})
    return [arm for arm in arms if tasks and tasks <= set(scores_of(cells, algo, arm, claims))]


def left_out(cells: list[Cell], algo: str, claims: Claims) -> str:
    """A sentence for captions that names the arms without finished runs on some of the tasks; may be empty."""
    tasks, complete = tasks_of(cells, algo, claims), complete_arms(cells, algo, claims)
    lacking = {}
    for arm in ordered_arms({cell.arm for cell in select(cells, algo)} - set(complete)):
        scores = scores_of(cells, algo, arm, claims)
        lacking[arm] = ", ".join(task_name(env) for env in tasks if env not in scores)
    shown = "; ".join(f"{actor_name(arm)} (no finished run on {envs})" for arm, envs in lacking.items() if envs)
    return f" Left out: {shown}." if shown else ""


def table(cells: list[Cell], claims: Claims) -> Table:
    """One row per algorithm and arm."""
    rows = []
    for algo in dict.fromkeys(cell.algo for cell in cells):
        tasks = tasks_of(cells, algo, claims)
        for arm in ordered_arms({cell.arm for cell in select(cells, algo)}):
            scores = scores_of(cells, algo, arm, claims)
            if not set(scores) & set(tasks):
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
            enough = min(map(len, values)) >= INTERVAL_SEEDS
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
        "Final performance over the claims' tasks, normalised: 0 is a uniformly random policy (measured by us, 100 "
        f"episodes), 100 a published artificial network after {sources['td3']['steps']:,} steps (TD3: "
        f"{sources['td3']['source']}: a maximum over training, which a final performance hardly reaches. SAC: "
        f"{sources['sac']['source']}). Tasks weigh the same. 95% intervals: stratified bootstrap over seeds, "
        f"{bootstrap.REPETITIONS:,} resamples, from {INTERVAL_SEEDS} seeds on. {covers(*AGGREGATES)} "
        f"{bootstrap.IQM}"
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
        paper=("Algorithm", "Actor", *(name for name, _ in METRICS.values())),
    )
