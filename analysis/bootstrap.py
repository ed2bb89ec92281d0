"""The stratified bootstrap of Agarwal et al. (2021), seeded: seeds are resampled with replacement within each task.

rliable's own ignores its ``random_state`` and needs the same number of runs for every task; this one takes a list
with one
array per task. Tested against rliable's.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
REPETITIONS = 10_000
CURVE_REPETITIONS = 2_000
CONFIDENCE = 0.95
SEED = 0
#: For captions of interquartile means.
IQM = "IQM: the mean of the runs' middle half, tasks weighing the same; a run at its edge counts in part."
#: A statistic takes one ``[repetitions, seeds of the task]`` array per task and gives ``[repetitions]``.
Statistic = Callable[[list[Array]], Array]


def iqm(tasks: list[Array]) -> Array:
    """Interquartile mean over all runs and tasks: of the pooled scores, without a quarter of the weight at each end.

    Tasks weigh the same, so a run weighs one over its task's number of runs; a run at the edge counts in part. Equal to
    SciPy's ``trim_mean(0.25)`` and rliable's where all tasks have as many runs and their total is a multiple of 4; else
    those cut less than a quarter.
    """
    pooled = np.concatenate(tasks, axis=1)
    weights = np.concatenate([np.full(task.shape[1], 1 / (task.shape[1] * len(tasks))) for task in tasks])
    if len({task.shape[1] for task in tasks}) == 1:  # equal weights, whatever the order
        return np.asarray(np.sort(pooled, axis=1) @ _middle_half(weights))
    order = np.argsort(pooled, axis=1, kind="stable")
    values = np.take_along_axis(pooled, order, axis=1)
    return np.asarray((values * _middle_half(weights[order])).sum(axis=1))


def _middle_half(weights: Array) -> Array:
    """What is left of ordered weights ``[..., runs]``, whose sum is 1, between 0.25 and 0.75; its sum is 1 again."""
    upper = np.cumsum(weights, axis=-1)
    return 2 * np.clip(np.minimum(upper, 0.75) - np.maximum(upper - weights, 0.25), 0, None)


def mean(tasks: list[Array]) -> Array:
    """Mean over tasks of the mean over seeds."""
    return np.mean([task.mean(axis=1) for task in tasks], axis=0)


def median(tasks: list[Array]) -> Array:
    """Median over tasks of the mean over seeds."""
    return np.median([task.mean(axis=1) for task in tasks], axis=0)


def optimality_gap(tasks: list[Array], gamma: float = 100.0) -> Array:
    """How far the scores, cut at ``gamma``, stay below it on average; tasks weigh the same."""
    return gamma - mean([np.minimum(task, gamma) for task in tasks])


def point(scores: Sequence[Array], statistic: Statistic) -> float:
    """The statistic of the observed scores, one array ``[seeds]`` per task."""
    return float(statistic([np.asarray(task, dtype=float)[None] for task in scores])[0])


def percentiles(samples: Array, axis: int = 0, confidence: float = CONFIDENCE) -> tuple[Array, Array]:
    """The percentile interval along ``axis``."""
    tail = (1 - confidence) / 2
    low, high = np.quantile(samples, [tail, 1 - tail], axis=axis)
    return low, high


def interval(
    scores: Sequence[Array], statistic: Statistic, repetitions: int = REPETITIONS, seed: int = SEED
) -> tuple[float, float]:
    """95% percentile interval of a statistic; scores are one array ``[seeds]`` per task, their lengths may differ.

    Raises:
        ValueError: a task has no seeds.
    """
    if not scores or any(len(task) == 0 for task in scores):
        raise ValueError("the bootstrap needs at least one seed in every task")
    generator = np.random.default_rng(seed)
    resampled = [
        np.asarray(task, dtype=float)[generator.integers(len(task), size=(repetitions, len(task)))] for task in scores
    ]
    low, high = percentiles(statistic(resampled))
    return float(low), float(high)


def curve_interval(
    scores: Sequence[Array], statistic: Statistic, repetitions: int = CURVE_REPETITIONS, seed: int = SEED
) -> tuple[Array, Array, Array]:
    """Point, low and high ``[steps]`` of a statistic by step; scores are one array ``[seeds, steps]`` per task.

    A resample draws whole runs, the same at every step: the seed is the unit, not the evaluation.
    """
    generator = np.random.default_rng(seed)
    picks = [generator.integers(len(task), size=(repetitions, len(task))) for task in scores]
    values, lows, highs = [], [], []
    for step in range(scores[0].shape[1]):
        at_step = [np.asarray(task[:, step], dtype=float) for task in scores]
        values.append(point(at_step, statistic))
        low, high = percentiles(statistic([task[pick] for task, pick in zip(at_step, picks)]))
        lows.append(float(low))
        highs.append(float(high))
    return np.array(values), np.array(lows), np.array(highs)


def profile(scores: Sequence[Array], thresholds: Array) -> Array:
    """Performance profile: share of runs above each threshold, tasks weighing the same, ``[thresholds]``."""
    return np.mean([(np.asarray(task)[:, None] > thresholds).mean(axis=0) for task in scores], axis=0)


def profile_interval(
    scores: Sequence[Array], thresholds: Array, repetitions: int = CURVE_REPETITIONS, seed: int = SEED
) -> tuple[Array, Array]:
    """Pointwise 95% interval of :func:`profile`."""
    generator = np.random.default_rng(seed)
    total = np.zeros((repetitions, len(thresholds)))
    for task in scores:
        above = (np.asarray(task)[:, None] > thresholds).astype(float)
        weights = generator.multinomial(len(task), np.full(len(task), 1 / len(task)), size=repetitions) / len(task)
        total += weights @ above
    return percentiles(total / len(scores))


def improvement_interval(
    x: Sequence[Array], y: Sequence[Array], repetitions: int = REPETITIONS, seed: int = SEED
) -> tuple[float, float]:
    """95% interval of the probability of improvement P(X > Y) + P(X = Y) / 2, averaged over tasks."""
    generator = np.random.default_rng(seed)
    total = np.zeros(repetitions)
    for a, b in zip(x, y, strict=True):
        wins = (a[:, None] > b[None]) + 0.5 * (a[:, None] == b[None])
        weights = [
            generator.multinomial(len(v), np.full(len(v), 1 / len(v)), size=repetitions) / len(v) for v in (a, b)
        ]
        total += ((weights[0] @ wins) * weights[1]).sum(axis=1)
    low, high = percentiles(total / len(x))
    return float(low), float(high)
