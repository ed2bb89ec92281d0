"""A study cut into cells: the seeds of one arm on one task under one algorithm, as arrays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis import metrics
from analysis.data.names import in_order
from analysis.data.outcome import Outcome, counts
from analysis.data.study import Study

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Cell:
    """The runs of one cell that count (finished or diverged), and all its runs.

    Attributes:
        steps: ``[steps]``, the union over the counted seeds.
        returns: ``[seeds, steps]``, each the mean of an evaluation's episodes; NaN where a seed was not evaluated.
        final: ``[seeds]``, final performance.
        diverged: ``[seeds]``, whose last value is carried forward.
        unfinished: number of further runs, which are drawn in curves only.
        waiting: how far those are, such as ``running, 4,350 of 100,000``; empty where there are none.
    """

    algo: str
    env: str
    arm: str
    paper: bool
    training_steps: int
    seeds: NDArray[np.int64]
    steps: NDArray[np.int64]
    returns: Array
    final: Array
    diverged: NDArray[np.bool_]
    unfinished: int
    waiting: str
    all_evaluations: pd.DataFrame

    @property
    def n(self) -> int:
        """Seeds that count."""
        return len(self.seeds)

    def without_diverged(self) -> Array:
        """Final performance of the runs that did not diverge, ``[seeds]``."""
        return self.final[~self.diverged]


def cells_of(study: Study) -> list[Cell]:
    """Every cell that has a run, in the order of tables: algorithm, task, arm."""
    if study.runs.empty:
        return []
    evaluations = dict(list(study.evaluations.groupby(["algo", "env", "arm"], sort=False)))
    nothing = study.evaluations.iloc[:0]
    found = dict(list(study.runs.groupby(["algo", "env", "arm"], sort=False)))
    return [_cell(*key, found[key], evaluations.get(key, nothing)) for key in in_order(found)]


def _cell(algo: str, env: str, arm: str, runs: pd.DataFrame, evaluations: pd.DataFrame) -> Cell:
    counted = runs[counts(runs)].sort_values("seed")
    steps, returns, seeds = metrics.seed_matrix(evaluations[counts(evaluations)])
    training_steps = int(runs["training_steps"].iloc[0])
    return Cell(
        algo=algo,
        env=env,
        arm=arm,
        paper=bool(runs["paper"].all()),
        training_steps=training_steps,
        seeds=seeds,
        steps=steps,
        returns=returns,
        final=metrics.final_performance(steps, returns, training_steps),
        diverged=counted["counts_as"].eq(Outcome.DIVERGED).to_numpy(dtype=bool),
        unfinished=len(runs) - len(counted),
        waiting=_waiting(runs[~counts(runs)]),
        all_evaluations=evaluations,
    )


def _waiting(runs: pd.DataFrame) -> str:
    if runs.empty:
        return ""
    kinds = runs["status"].value_counts().sort_index()
    words = ", ".join(f"{count} {kind}" if len(runs) > 1 else str(kind) for kind, count in kinds.items())
    furthest = runs.assign(step=runs["step"].fillna(0)).sort_values(["step", "seed"]).iloc[-1]
    reached = f"{int(furthest['step']):,} of {int(furthest['total_steps']):,}"
    return f"{words}, {'the furthest ' if len(runs) > 1 else ''}{reached}"


def select(cells: list[Cell], algo: str | None = None, env: str | None = None, arm: str | None = None) -> list[Cell]:
    """The cells that match what is given."""
    return [cell for cell in cells if algo in (None, cell.algo) and env in (None, cell.env) and arm in (None, cell.arm)]
