"""Welch's contrast of means, Holm's correction, and the seeds that a stated effect needs.

A contrast is ``L = sum_i c_i mean_i`` over independent arms with unequal variances. With ``c = (1, -1)`` it is
Welch's test; with ``(1, -1, -1, 1)`` the interaction of a 2x2 design; with ``c_i / tasks`` over all arms of all tasks
an effect pooled over tasks. Standard error ``SE^2 = sum_i c_i^2 s_i^2 / n_i``; degrees of freedom by Welch and
Satterthwaite, ``df = SE^4 / sum_i (c_i^2 s_i^2 / n_i)^2 / (n_i - 1)``.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import scipy.optimize
import scipy.stats
from numpy.typing import NDArray
from statsmodels.stats.multitest import multipletests

Array = NDArray[np.float64]
#: Fewer seeds in an arm: no interval.
INTERVAL_SEEDS = 3
#: Fewer seeds in an arm: no test and no verdict.
TEST_SEEDS = 5
MOST_SEEDS = 10_000
#: Standard deviations below this share of the largest absolute score are rounding, not variance.
ROUNDING = 1e-9
_NAN = float("nan")


class Contrast(NamedTuple):
    """``estimate``, its 95% interval, two-sided ``p``, degrees of freedom and standard error.

    ``low``, ``high``, ``df`` and ``error`` are NaN below ``INTERVAL_SEEDS`` in an arm, ``p`` below ``TEST_SEEDS``; all
    of them where nothing varies.
    """

    estimate: float
    low: float
    high: float
    p: float
    df: float
    error: float

    def scaled(self, factor: float) -> Contrast:
        """The same contrast in other units, ``factor > 0`` of the new for one of the old."""
        return self._replace(
            estimate=self.estimate * factor, low=self.low * factor, high=self.high * factor, error=self.error * factor
        )


NOTHING = Contrast(_NAN, _NAN, _NAN, _NAN, _NAN, _NAN)


class Moments(NamedTuple):
    """Number, mean and variance (ddof=1) of an arm's scores; the number need not be whole."""

    n: float
    mean: float
    variance: float


def moments(arm: Array) -> Moments:
    """Of an arm ``[seeds]`` with at least two seeds."""
    return Moments(len(arm), float(arm.mean()), float(arm.var(ddof=1)))


def welch(arms: Sequence[Moments], weights: Sequence[float]) -> tuple[float, float, float]:
    """Estimate, standard error and degrees of freedom of ``sum_i weights_i * mean_i``."""
    parts = np.array([c**2 * arm.variance / arm.n for c, arm in zip(weights, arms, strict=True)])
    freedom = np.array([arm.n - 1 for arm in arms])
    estimate = sum(c * arm.mean for c, arm in zip(weights, arms, strict=True))
    return estimate, float(np.sqrt(parts.sum())), float(parts.sum() ** 2 / (parts**2 / freedom).sum())


def welch_contrast(arms: Sequence[Array], weights: Sequence[float], confidence: float = 0.95) -> Contrast:
    """``sum_i weights_i * mean(arms_i)``, each arm ``[seeds]``; see :class:`Contrast` for what few seeds leave out."""
    if not arms or any(len(arm) == 0 for arm in arms):
        return NOTHING
    if any(len(arm) < INTERVAL_SEEDS for arm in arms) or not varies(arms):
        return NOTHING._replace(estimate=float(sum(c * arm.mean() for c, arm in zip(weights, arms, strict=True))))
    estimate, error, df = welch([moments(arm) for arm in arms], weights)
    half = error * float(scipy.stats.t.ppf((1 + confidence) / 2, df))
    p = 2 * float(scipy.stats.t.sf(abs(estimate) / error, df))
    enough = all(len(arm) >= TEST_SEEDS for arm in arms)
    return Contrast(estimate, estimate - half, estimate + half, p if enough else _NAN, df, error)


def varies(arms: Sequence[Array]) -> bool:
    """Whether the seeds of any arm differ by more than rounding."""
    largest = max(float(np.abs(arm).max()) for arm in arms)
    return any(float(arm.std()) > ROUNDING * largest for arm in arms)


def one_sided_p(contrast: Contrast) -> float:
    """P of ``L <= 0`` against ``L > 0``; NaN where there is no test."""
    if np.isnan(contrast.p):
        return _NAN
    return float(scipy.stats.t.sf(contrast.estimate / contrast.error, contrast.df))


def t_interval(values: Array, confidence: float = 0.95) -> tuple[float, float]:
    """Student's interval of the mean of ``values [seeds]``; NaN below ``INTERVAL_SEEDS``."""
    if len(values) < INTERVAL_SEEDS:
        return _NAN, _NAN
    half = float(scipy.stats.sem(values)) * float(scipy.stats.t.ppf((1 + confidence) / 2, len(values) - 1))
    return float(values.mean()) - half, float(values.mean()) + half


def holm(p_values: Sequence[float] | Array) -> Array:
    """Holm-adjusted p-values ``[tests]``; NaN (not testable) counts as 1 and is given back as NaN.

    A family is what was declared: a test that cannot be made yet does not make the others easier.
    """
    given = np.asarray(p_values, dtype=float)
    if not len(given):
        return given
    adjusted = np.asarray(multipletests(np.nan_to_num(given, nan=1.0), method="holm")[1])
    return np.where(np.isnan(given), np.nan, adjusted)


def power(n: int, effect: float, std: float, weights: Sequence[float], alpha: float) -> float:
    """Power of the two-sided contrast test with ``n`` seeds in every arm, all with standard deviation ``std``."""
    df = len(weights) * (n - 1)
    shift = abs(effect) / (std * float(np.sqrt(np.square(weights).sum() / n)))
    bound = float(scipy.stats.t.ppf(1 - alpha / 2, df))
    near = float(scipy.stats.nct.sf(bound, df, shift))
    far = float(scipy.stats.nct.cdf(-bound, df, shift))
    if np.isnan(near):  # SciPy's noncentral t gives up far from 0, where the power is 1
        return 1.0 if shift > bound else _NAN
    return near + (0.0 if np.isnan(far) else far)  # the far tail is the first to underflow


def spread_within(arms: Sequence[Array]) -> float:
    """Standard deviation within arms, pooled over them: ``sqrt(sum of squares / degrees of freedom)``; NaN if none."""
    freedom = sum(max(len(arm) - 1, 0) for arm in arms)
    squares = sum(float(np.square(arm - arm.mean()).sum()) for arm in arms if len(arm))
    return float(np.sqrt(squares / freedom)) if freedom else _NAN


def seeds_for_effect(
    effect: float, std: float, weights: Sequence[float], alpha: float = 0.05, wanted: float = 0.8
) -> int | None:
    """Smallest number of seeds per arm, at least ``TEST_SEEDS``, that detects a stated effect with the wanted power.

    None where the spread is unknown or 0, or more than ``MOST_SEEDS`` would be needed.
    """
    if not std > 0 or power(MOST_SEEDS, effect, std, weights, alpha) < wanted:
        return None
    low, high = TEST_SEEDS - 1, MOST_SEEDS
    while high - low > 1:
        middle = (low + high) // 2
        if power(middle, effect, std, weights, alpha) >= wanted:
            high = middle
        else:
            low = middle
    return high


def detectable_effect(n: int, weights: Sequence[float], alpha: float, wanted: float) -> float:
    """The effect, in standard deviations, that ``n`` seeds in every arm detect with the wanted power."""
    return float(scipy.optimize.brentq(lambda effect: power(n, effect, 1.0, weights, alpha) - wanted, 1e-6, 200.0))
