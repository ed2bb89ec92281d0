"""Whether a run counts: the one place that decides it.

Finished runs count, and diverged ones with their last value carried forward. All others are drawn in curves only:
running, interrupted and failed ones, finished ones of another length than their task's, and those whose evaluations do
not show what their manifest says.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
import pandas as pd

from analysis.data.arms import algorithm_of, arm_of
from analysis.data.reading import Run
from analysis.data.schema import Status
from analysis.data.training_steps import missing_evaluations, most_frequent


class Outcome(StrEnum):
    """What a run is to the numbers; in ``collected/`` the column ``counts_as``."""

    FINISHED = "finished"
    DIVERGED = "diverged"
    UNFINISHED = "unfinished"


_BY_STATUS = {Status.COMPLETE: Outcome.FINISHED, Status.DIVERGED: Outcome.DIVERGED}


def counts(runs: pd.DataFrame) -> pd.Series:
    """Which rows (of runs or evaluations) count, by their column ``counts_as``: booleans."""
    return runs["counts_as"].isin([Outcome.FINISHED, Outcome.DIVERGED])


@dataclass(frozen=True)
class RunOutcome:
    """A run and what it is to the numbers.

    Attributes:
        run: the run.
        outcome: finished, diverged or unfinished.
        evaluations: its finite evaluations, ``step, return, length``.
        training_steps: how long the runs of its task and algorithm are trained.
        warnings: sentences without a subject, about the outcome.
    """

    run: Run
    outcome: Outcome
    evaluations: pd.DataFrame
    training_steps: int
    warnings: tuple[str, ...]


def outcomes_of(runs: list[Run]) -> list[RunOutcome]:
    """The outcome of each run of a study, in their order."""
    alone = [_alone(run) for run in runs]
    tasks = [(algorithm_of(run), run.manifest.env) for run in runs]
    lengths = {task: _training_steps([one for one, its in zip(alone, tasks) if its == task]) for task in set(tasks)}
    return [_among_others(one, lengths[task]) for one, task in zip(alone, tasks)]


def _alone(run: Run) -> RunOutcome:
    """What its own files make of it; ``training_steps`` is what it was asked for."""
    outcome = _BY_STATUS.get(run.manifest.status, Outcome.UNFINISHED)
    finite = np.isfinite(run.evaluations["return"].to_numpy(dtype=float))
    evaluations = run.evaluations[finite].reset_index(drop=True)
    last = int(evaluations["step"].max()) if len(evaluations) else -1
    warnings: list[str] = []
    lost = run.evaluations.loc[~finite, "step"]
    if (lost > last).any():
        outcome = Outcome.DIVERGED
        warnings.append(f"{len(lost)} evaluation(s) hold non-finite returns; the run counts as diverged")
    elif len(lost):
        where = ", ".join(f"{step:,}" for step in lost.head(3))
        warnings.append(
            f"{len(lost)} evaluation(s) hold non-finite returns and were left out (step {where}); finite ones follow, "
            "so nothing is carried forward"
        )
    asked = run.manifest.total_steps
    if outcome == Outcome.FINISHED and last != asked:
        outcome = Outcome.UNFINISHED
        reached = f"its evaluations end at step {last:,} of {asked:,}" if last >= 0 else "it has no evaluation"
        warnings.append(f"its manifest says complete, but {reached}; it counts as unfinished")
    elif outcome == Outcome.FINISHED and run.manifest.step not in (None, asked):
        warnings.append(f"its manifest says complete at step {run.manifest.step:,} of {asked:,}")
    if outcome == Outcome.DIVERGED and last < 0:
        outcome = Outcome.UNFINISHED
        warnings.append(
            "it diverged before its first evaluation, so there is no value to carry forward; it counts as unfinished"
        )
    return RunOutcome(run, outcome, evaluations, asked, tuple(warnings))


def _training_steps(runs: list[RunOutcome]) -> int:
    """Of the paper's finished runs, else of all finished ones, else of those that count, else of all."""
    finished = [one for one in runs if one.outcome == Outcome.FINISHED]
    counted = [one for one in runs if one.outcome != Outcome.UNFINISHED]
    paper = [one for one in finished if arm_of(one.run)[1]]
    chosen = paper or finished or counted or runs
    return most_frequent([one.training_steps for one in chosen])


def _among_others(alone: RunOutcome, training_steps: int) -> RunOutcome:
    outcome = alone.outcome
    asked = alone.training_steps
    warnings = list(alone.warnings)
    if outcome != Outcome.UNFINISHED and asked != training_steps:
        outcome = Outcome.UNFINISHED
        warnings.append(
            f"it was asked for {asked:,} steps, others of its task for {training_steps:,}; "
            "results after unequal training are not compared, so it stands in curves only, among the unfinished"
        )
    elif outcome == Outcome.FINISHED:
        interval = alone.run.settings.protocol.evaluation_interval
        warnings += missing_evaluations(alone.run.evaluations["step"], interval, training_steps)
    return RunOutcome(alone.run, outcome, alone.evaluations, training_steps, tuple(warnings))
