"""Final performance and the two readings of "max average return", per cell and per seed."""

from __future__ import annotations

import numpy as np
import pandas as pd

from analysis import metrics
from analysis.bootstrap import IQM, interval, iqm, point
from analysis.coverage import covers
from analysis.data.cells import Cell
from analysis.data.names import actor_name, algorithm_name, task_name
from analysis.hypothesis_tests import INTERVAL_SEEDS, t_interval
from analysis.tables import Column, Table, number, pair, spread, text

_WHERE: list[Column] = [("algorithm", "Algorithm", text), ("task", "Task", text), ("actor", "Actor", text)]
FINAL = (
    "Final performance: mean of a run's evaluations in the last 10% of its steps; ± one standard deviation over "
    "seeds (ddof=1)."
)


def mean_and_std(values: np.ndarray) -> tuple[float, float]:
    """Mean and standard deviation (ddof=1) of ``values [seeds]``; NaN where there are too few."""
    mean = float(values.mean()) if len(values) else np.nan
    return mean, float(values.std(ddof=1)) if len(values) > 1 else np.nan


def cell_names(cell: Cell) -> dict[str, object]:
    """Which cell a row is of: for programs, then for people."""
    return {
        "algo": cell.algo,
        "env": cell.env,
        "arm": cell.arm,
        "algorithm": algorithm_name(cell.algo),
        "task": task_name(cell.env),
        "actor": actor_name(cell.arm),
    }


def final_table(cells: list[Cell]) -> Table:
    """Final performance in full: mean, std, IQM, with and without diverged runs."""
    rows = []
    for cell in cells:
        enough = cell.n >= INTERVAL_SEEDS
        low, high = interval([cell.final], iqm) if enough else (np.nan, np.nan)
        centre = point([cell.final], iqm) if cell.n else np.nan
        mean_low, mean_high = t_interval(cell.final)
        mean, std = mean_and_std(cell.final)
        without = cell.without_diverged()
        mean_without, std_without = mean_and_std(without)
        diverged = int(cell.diverged.sum())
        rows.append(
            {
                **cell_names(cell),
                "n": cell.n,
                "mean": mean,
                "mean_low": mean_low,
                "mean_high": mean_high,
                "mean_shown": pair(mean, mean_low, mean_high),
                "std": std,
                "iqm": centre,
                "iqm_low": low,
                "iqm_high": high,
                "diverged": diverged,
                "mean_without_diverged": mean_without,
                "std_without_diverged": std_without,
                "unfinished": cell.unfinished,
                "total_steps": cell.training_steps,
                "iqm_shown": pair(centre, low, high),
                "shown": spread(mean, std, cell.n),
                "without": spread(mean_without, std_without, len(without)) if diverged else "–",
            }
        )
    columns: list[Column] = [
        *_WHERE,
        ("total_steps", "Steps", number()),
        ("shown", "Mean ± std", str),
        ("mean_shown", "Mean [95% t]", str),
        ("iqm_shown", "IQM [95% bootstrap]", str),
        ("diverged", "Diverged", number()),
        ("without", "Without diverged", str),
        ("unfinished", "Unfinished", number()),
    ]
    caption = (
        f"{FINAL} Mean [95%]: Student's t. {covers('mean')} IQM over seeds with its bootstrap interval. "
        f"{covers('iqm of one task')} Both from {INTERVAL_SEEDS} seeds on. {IQM} Unfinished runs stand in curves only."
    )
    keys = [key for key, _, _ in columns]
    frame = pd.DataFrame(rows) if rows else pd.DataFrame(columns=keys)
    return Table("final_performance", "statistics", "Final performance in full", caption, frame, columns)


def maxima_table(cells: list[Cell]) -> Table:
    """Both readings of the paper's "max average returns over 10 seeds"."""
    rows = []
    for cell in cells:
        of_mean, of_max = metrics.max_of_mean(cell.steps, cell.returns), metrics.mean_of_max(cell.returns)
        rows.append(
            {
                **cell_names(cell),
                "n": cell.n,
                "max_of_mean": of_mean.value,
                "max_of_mean_std": of_mean.std,
                "max_of_mean_step": of_mean.step,
                "mean_of_max": of_max.value,
                "mean_of_max_std": of_max.std,
                "first": spread(of_mean.value, of_mean.std, cell.n),
                "second": spread(of_max.value, of_max.std, cell.n),
            }
        )
    columns: list[Column] = [
        *_WHERE,
        ("first", "max_of_mean ± std", str),
        ("max_of_mean_step", "at step", number()),
        ("second", "mean_of_max ± std", str),
    ]
    caption = (
        "max_of_mean: the largest value of the seeds' mean curve, ± the standard deviation over seeds at that step; "
        "the ablation bars draw it. mean_of_max: mean over seeds of each seed's own maximum; it rewards noise and is "
        "never smaller. Nothing is smoothed."
    )
    frame = pd.DataFrame(rows) if rows else pd.DataFrame(columns=[key for key, _, _ in columns])
    return Table("max_average_return", "statistics", "Max average return, both readings", caption, frame, columns)


def seeds_table(cells: list[Cell]) -> Table:
    """Each run's final performance and own maximum."""
    rows = [
        {
            **cell_names(cell),
            "seed": int(seed),
            "final": float(final),
            "maximum": float(np.nanmax(curve)),
            "state": "diverged" if diverged else "finished",
        }
        for cell in cells
        for seed, final, curve, diverged in zip(cell.seeds, cell.final, cell.returns, cell.diverged)
    ]
    columns: list[Column] = [
        *_WHERE,
        ("seed", "Seed", number()),
        ("final", "Final performance", number()),
        ("maximum", "Maximum", number()),
        ("state", "", text),
    ]
    frame = pd.DataFrame(rows) if rows else pd.DataFrame(columns=[key for key, _, _ in columns])
    return Table(
        "seeds",
        "statistics",
        "Every seed",
        "The values that all statistics are computed from.",
        frame,
        columns,
        folded=True,
    )
