"""Welch's test as a contrast of means, Holm's correction, and the seeds that a test would need.

A contrast is ``L = sum_i c_i mean_i`` over independent arms with unequal variances. With ``c = (1, -1)`` it is
Welch's test
(the tests compare it with SciPy's); with ``(1, -1, -1, 1)`` the interaction of a 2x2 design. Standard error
``SE^2 = sum_i c_i^2 s_i^2 / n_i``; degrees of freedom by Welch and Satterthwaite,
``df = SE^4 / sum_i (c_i^2 s_i^2 / n_i)^2 / (n_i - 1)``.
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
MINIMUM_SEEDS = 3
MOST_SEEDS = 10_000


class Contrast(NamedTuple):
    """A tested contrast; ``p`` is two-sided; everything but ``estimate`` is NaN where nothing can be tested."""

    estimate: float
    low: float
    high: float
    p: float
    df: float


def welch_contrast(
    arms: Sequence[Array], weights: Sequence[float], confidence: float = 0.95, minimum: int = MINIMUM_SEEDS
) -> Contrast:
    """Estimate, interval and two-sided p of ``sum_i weights_i * mean(arms_i)``, each arm ``[seeds]``.

    Fewer than ``minimum`` seeds in an arm, or no variance in any: the estimate alone.
    """
    if any(len(arm) == 0 for arm in arms):
        return Contrast(np.nan, np.nan, np.nan, np.nan, np.nan)
    estimate = float(sum(c * arm.mean() for c, arm in zip(weights, arms, strict=True)))
    if any(len(arm) < minimum for arm in arms):
        return Contrast(estimate, np.nan, np.nan, np.nan, np.nan)
    parts = np.array([c**2 * arm.var(ddof=1) / len(arm) for c, arm in zip(weights, arms, strict=True)])
    if not parts.sum() > 0:
        return Contrast(estimate, np.nan, np.nan, np.nan, np.nan)
    freedom = np.array([len(arm) - 1 for arm in arms])
    error, df = float(np.sqrt(parts.sum())), float(parts.sum() ** 2 / (parts**2 / freedom).sum())
    p = 2 * float(scipy.stats.t.sf(abs(estimate) / error, df))
    half = error * float(scipy.stats.t.ppf((1 + confidence) / 2, df))
    return Contrast(estimate, estimate - half, estimate + half, p, df)


def t_interval(values: Array, confidence: float = 0.95, minimum: int = MINIMUM_SEEDS) -> tuple[float, float]:
    """Student's interval of the mean of ``values [seeds]``; NaN below ``minimum`` seeds."""
    n = len(values)
    if n < max(minimum, 2):
        return np.nan, np.nan
    half = float(values.std(ddof=1)) / np.sqrt(n) * float(scipy.stats.t.ppf((1 + confidence) / 2, n - 1))
    return float(values.mean() - half), float(values.mean() + half)


def holm(p_values: Array, alpha: float = 0.05) -> Array:
    """Holm-adjusted p-values ``[tests]``; NaN (not tested) stays NaN and does not count."""
    adjusted = np.full(len(p_values), np.nan)
    tested = ~np.isnan(p_values)
    if tested.any():
        adjusted[tested] = multipletests(p_values[tested], alpha=alpha, method="holm")[1]
    return adjusted


def power(n: int, estimate: float, stds: Array, weights: Sequence[float], alpha: float) -> float:
    """Power of the two-sided contrast test with ``n`` seeds in every arm, if the observed means and ``stds [arms]``
    were true.
    """
    parts = np.array([c**2 * s**2 for c, s in zip(weights, stds, strict=True)]) / n
    df = float(parts.sum() ** 2 / (parts**2).sum() * (n - 1))
    shift, bound = abs(estimate) / float(np.sqrt(parts.sum())), float(scipy.stats.t.ppf(1 - alpha / 2, df))
    near = float(scipy.stats.nct.sf(bound, df, shift))
    far = float(scipy.stats.nct.cdf(-bound, df, shift))
    if np.isnan(near):  # SciPy's noncentral t gives up far from 0, where the power is 1
        return 1.0 if shift > bound else np.nan
    return near + (0.0 if np.isnan(far) else far)  # the far tail is the first to underflow


def seeds_for_power(
    arms: Sequence[Array], weights: Sequence[float], alpha: float = 0.05, wanted: float = 0.8
) -> int | None:
    """Smallest number of seeds per arm (at least 3) with the wanted power at the observed effect.

    None where the effect is 0, a variance is unknown, or more than ``MOST_SEEDS`` would be needed.
    """
    if any(len(arm) < 2 for arm in arms):
        return None
    estimate = float(sum(c * arm.mean() for c, arm in zip(weights, arms, strict=True)))
    stds = np.array([arm.std(ddof=1) for arm in arms])
    if estimate == 0 or not stds.sum() > 0:
        return None
    if power(MOST_SEEDS, estimate, stds, weights, alpha) < wanted:
        return None
    low, high = MINIMUM_SEEDS - 1, MOST_SEEDS
    while high - low > 1:
        middle = (low + high) // 2
        if power(middle, estimate, stds, weights, alpha) >= wanted:
            high = middle
        else:
            low = middle
    return high


def detectable_effect(n: int, alpha: float, wanted: float) -> float:
    """The difference in standard deviations that ``n`` against ``n`` seeds detect with the wanted power."""

    def lacking(effect: float) -> float:
        return power(n, effect, np.ones(2), (1.0, -1.0), alpha) - wanted

    return float(scipy.optimize.brentq(lacking, 1e-6, 200.0))


def verdict(adjusted_p: float, estimate: float, alpha: float = 0.05) -> str:
    """METHOD's rule: ``supported`` if adjusted p < alpha in the claimed direction, ``contradicted`` in the other,
    else ``undecided``.
    """
    if np.isnan(adjusted_p) or not adjusted_p < alpha:
        return "undecided"
    return "supported" if estimate > 0 else "contradicted"
