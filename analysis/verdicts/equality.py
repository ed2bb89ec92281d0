"""Layer "equal": whether a pooled effect is smaller than the smallest relevant one, whatever failures were not seen.

Two one-sided tests (Schuirmann 1987): the 90% interval lies inside the margin. Where runs fail now and then, that alone
errs: 10 seeds on one task hold no failure with probability 0.2 if 15% of the runs fail, and then look equal to the arm
that never does. So each test counts one more run, spread over the tasks, of each arm whose failure would carry the
effect towards its margin, at a random policy's score (or the arm's own lowest, if that is lower): ten seeds of good
actors on one or two tasks never show a difference below 15 points, forty runs can. Calibrated by
``python -m benchmarks.calibration``.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.stats
from numpy.typing import NDArray

from analysis.hypothesis_tests import TEST_SEEDS, Moments, moments, varies, welch

Array = NDArray[np.float64]
RANDOM_POLICY = 0.0  # in normalised points


def equality_p(tasks: Sequence[Sequence[Array]], weights: Sequence[float], margin: float) -> float:
    """P of "the pooled effect is not within ± ``margin``", both in normalised points.

    ``tasks``: the arms of each task, ``[seeds]`` each, in the order of ``weights``. NaN where there is no test.
    """
    arms = [arm for task in tasks for arm in task]
    if not arms or any(len(arm) < TEST_SEEDS for arm in arms) or not varies(arms):
        return float("nan")
    pooled = [weight / len(tasks) for _ in tasks for weight in weights]
    p_values = []
    for sign in (1.0, -1.0):  # against +margin, against -margin
        counted = [
            with_failure(arm, 1 / len(tasks)) if sign * weight < 0 else moments(arm)
            for weight, arm in zip(pooled, arms)
        ]
        estimate, error, df = welch(counted, pooled)
        p_values.append(float(scipy.stats.t.sf((margin - sign * estimate) / error, df)))
    return max(p_values)


def with_failure(arm: Array, share: float) -> Moments:
    """Moments of ``arm [seeds]`` with ``share`` of one more run at a random policy's score, or at its own lowest."""
    n, mean, variance = moments(arm)
    score = min(RANDOM_POLICY, float(arm.min()))
    squares = (n - 1) * variance + n * share / (n + share) * (mean - score) ** 2
    return Moments(n + share, (n * mean + share * score) / (n + share), squares / (n + share - 1))
