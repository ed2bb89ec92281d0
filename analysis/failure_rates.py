"""The share of runs that fail: intervals, and the difference between two actors over tasks."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import scipy.stats
from numpy.typing import NDArray
from statsmodels.stats.contingency_tables import StratifiedTable
from statsmodels.stats.proportion import confint_proportions_2indep

from analysis.hypothesis_tests import TEST_SEEDS

Array = NDArray[np.float64]
_NAN = float("nan")


class Rate(NamedTuple):
    """A share with its 95% interval; NaN where there is none."""

    share: float
    low: float
    high: float


def failures(scores: Array, threshold: float) -> int:
    """How many normalised scores ``[seeds]`` lie below the threshold."""
    return int((scores < threshold).sum())


def rate(failed: int, n: int) -> Rate:
    """Clopper and Pearson's exact interval; NaN without runs."""
    if not n:
        return Rate(_NAN, _NAN, _NAN)
    interval = scipy.stats.binomtest(failed, n).proportion_ci(0.95)
    return Rate(failed / n, float(interval.low), float(interval.high))


def difference(failed: Sequence[tuple[int, int]], n: Sequence[tuple[int, int]]) -> tuple[Rate, float]:
    """First minus second, averaged over tasks, and the two-sided p of Mantel and Haenszel's test over tasks.

    ``failed`` and ``n`` hold (first, second) by task. Interval: Newcombe's of each task, their distances from the
    estimates added as squares. No p below ``TEST_SEEDS`` in an arm, or where no run or every run failed.
    """
    differences = np.array([a / m - b / k for (a, b), (m, k) in zip(failed, n, strict=True)])
    limits = np.array(
        [confint_proportions_2indep(a, m, b, k, method="newcomb") for (a, b), (m, k) in zip(failed, n, strict=True)]
    )
    estimate, tasks = float(differences.mean()), len(differences)
    low = estimate - float(np.sqrt(np.square(differences - limits[:, 0]).sum())) / tasks
    high = estimate + float(np.sqrt(np.square(limits[:, 1] - differences).sum())) / tasks
    total, runs = sum(map(sum, failed)), sum(map(sum, n))
    if min(min(counts) for counts in n) < TEST_SEEDS or total in (0, runs):
        return Rate(estimate, low, high), _NAN
    tables = [np.array([[a, m - a], [b, k - b]]) for (a, b), (m, k) in zip(failed, n)]
    mixed = [table for table in tables if 0 < table[:, 0].sum() < table.sum()]  # others say nothing about the odds
    p = float(StratifiedTable(mixed).test_null_odds(correction=True).pvalue)
    return Rate(estimate, low, high), p
