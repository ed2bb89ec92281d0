"""The first table: final performance of every label of the study, a row per actor, a column per task."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from analysis.claims_file import Claims
from analysis.data.cells import Cell, select
from analysis.data.mixed import Refused
from analysis.data.names import actor_name, algorithm_name, ordered_arms, ordered_tasks, task_name
from analysis.tables import NO_RUN, Column, Table, spread, text

REFUSED = "refused"


def main_table(cells: list[Cell], refused: list[Refused], claims: Claims) -> Table:
    """Mean ± standard deviation (n) of final performance; where no run counts yet, how far the runs are."""
    every: list[Cell | Refused] = [*cells, *refused]
    tasks = ordered_tasks({cell.env for cell in every})
    rows: list[dict[str, Any]] = []
    for algo in dict.fromkeys(cell.algo for cell in every):
        for arm in ordered_arms({cell.arm for cell in every if cell.algo == algo}):
            found = {cell.env: _shown(cell) for cell in select(cells, algo, arm=arm)}
            found |= {cell.env: REFUSED for cell in refused if (cell.algo, cell.arm) == (algo, arm)}
            shown = {env: found.get(env, NO_RUN) for env in tasks}
            rows.append(
                {"algorithm": algorithm_name(algo), "actor": actor_name(arm), "algo": algo, "arm": arm, **shown}
            )
    columns: list[Column] = [
        ("algorithm", "Algorithm", text),
        ("actor", "Actor", text),
        *((env, task_name(env), str) for env in tasks),
    ]
    absent = [task_name(env) for env in claims.tasks if env not in tasks]
    without = f" No runs on {', '.join(absent)}." if absent and tasks else ""
    caption = (
        "Final performance: mean of a run's evaluations in the last 10% of its steps; ± one standard deviation over "
        f"seeds (ddof=1). n: finished runs, and diverged ones with their last value carried forward.{without}"
    )
    if refused:
        caption += " Refused: the cell mixes configurations; the notes say which."
    frame = pd.DataFrame(rows, columns=["algorithm", "actor", "algo", "arm", *tasks])
    best = frozenset(_best(cells, rows, tasks))
    return Table("main", "main", "Final performance", caption, frame, columns, "No runs yet.", best=best, stacked=True)


def _shown(cell: Cell) -> str:
    if not cell.n:
        return cell.waiting
    std = float(cell.final.std(ddof=1)) if cell.n > 1 else np.nan
    return spread(float(cell.final.mean()), std, cell.n)


def _best(cells: list[Cell], rows: list[dict[str, Any]], tasks: list[str]) -> list[tuple[int, int]]:
    """The printed cells with the highest mean of their task and algorithm."""
    found = []
    for column, env in enumerate(tasks, start=2):
        for algo in dict.fromkeys(row["algo"] for row in rows):
            means = {cell.arm: float(cell.final.mean()) for cell in select(cells, algo, env) if cell.n}
            if len(means) > 1:
                winner = max(means, key=lambda arm: means[arm])
                found += [(k, column) for k, row in enumerate(rows) if (row["algo"], row["arm"]) == (algo, winner)]
    return found
