"""Probability of improvement, by rliable, for arms whose tasks may have unequal numbers of seeds; its interval by our
bootstrap.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from rliable import metrics as rliable_metrics

from analysis.bootstrap import improvement_interval
from analysis.hypothesis_tests import INTERVAL_SEEDS

Array = NDArray[np.float64]


def probability_of_improvement(x: Sequence[Array], y: Sequence[Array]) -> float:
    """P(a seed of X beats a seed of Y), ties half, averaged over tasks (Agarwal et al. 2021).

    One array ``[seeds]`` per task.
    """
    values = [
        float(rliable_metrics.probability_of_improvement(np.asarray(a)[:, None], np.asarray(b)[:, None]))
        for a, b in zip(x, y, strict=True)
    ]
    return float(np.mean(values))


#: For captions.
SEPARATED = "No interval stands where all seeds of one arm beat all of the other: resampling them cannot vary that."


def improvement_with_interval(x: Sequence[Array], y: Sequence[Array]) -> tuple[float, float, float]:
    """The probability and its 95% bootstrap interval.

    The interval is NaN below ``INTERVAL_SEEDS`` in an arm, and where every task is completely separated or tied, so
    that every resample gives the same number.
    """
    value = probability_of_improvement(x, y)
    if min(len(arm) for arm in (*x, *y)) < INTERVAL_SEEDS:
        return value, np.nan, np.nan
    low, high = improvement_interval(x, y)
    return (value, low, high) if high > low else (value, np.nan, np.nan)
