"""The metrics as pure functions of arrays. Rows are seeds, columns are evaluation steps; NaN is "not measured".

Sources: the paper's captions ("half a standard deviation", "max average returns over 10 seeds", "smoothed for improved
visualization"); what they leave open is decided in ``docs/report.md``.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Curve(NamedTuple):
    """Mean over seeds by step; every field is ``[steps]``."""

    mean: Array
    std: Array  # ddof=1; NaN where n < 2
    n: NDArray[np.int64]


class Maximum(NamedTuple):
    """One reading of "max average return"."""

    value: float
    std: float  # ddof=1 over seeds; NaN for one seed
    step: float  # where; NaN for ``mean_of_max``, whose seeds have their maxima at different steps


def seed_matrix(evaluations: pd.DataFrame) -> tuple[NDArray[np.int64], Array, NDArray[np.int64]]:
    """Long rows ``(seed, step, return)`` of one cell -> steps ``[s]``, returns ``[seeds, s]``, seeds ``[seeds]``,
    both sorted.
    """
    table = evaluations.pivot(index="seed", columns="step", values="return").sort_index().sort_index(axis=1)
    return table.columns.to_numpy(dtype=np.int64), table.to_numpy(dtype=float), table.index.to_numpy(dtype=np.int64)


def mean_curve(returns: Array) -> Curve:
    """Mean, standard deviation (ddof=1) and number of seeds at each step of ``returns [seeds, steps]``."""
    frame = pd.DataFrame(returns)
    return Curve(
        frame.mean().to_numpy(float), frame.std(ddof=1).to_numpy(float), frame.count().to_numpy().astype(np.int64)
    )


def half_std(returns: Array) -> Array:
    """Half-width of the paper's band: ``std / 2`` with ddof=1, ``[steps]``; NaN where a single seed was measured."""
    return 0.5 * mean_curve(returns).std


def smoothing_window(evaluations: int) -> int:
    """A tenth of the evaluations rounded to the nearest odd number, at least 3: 11 of 101, 3 of 21."""
    return max(3, 2 * int(evaluations / 20) + 1)


def smooth(values: Array, window: int) -> Array:
    """Centred moving average over ``window`` evaluations, ``[steps] -> [steps]``; for display only.

    At the edges the window is shortened on both sides alike, so that it stays centred: the first and last value are
    themselves. NaN inside a window is left out of its mean.

    Raises:
        ValueError: the window is even (it would have no centre) or not positive.
    """
    if window < 1 or window % 2 == 0:
        raise ValueError(f"a centred window is odd and positive, not {window}")
    measured = ~np.isnan(values)
    sums = np.concatenate([[0.0], np.cumsum(np.where(measured, values, 0.0))])
    counts = np.concatenate([[0], np.cumsum(measured)])
    at = np.arange(len(values))
    reach = np.minimum(window // 2, np.minimum(at, len(values) - 1 - at))
    low, high = at - reach, at + reach + 1
    with np.errstate(invalid="ignore"):
        return np.asarray(
            (sums[high] - sums[low]) / np.where(counts[high] > counts[low], counts[high] - counts[low], np.nan)
        )


def max_of_mean(steps: NDArray[np.int64], returns: Array) -> Maximum:
    """Largest value of the seeds' mean curve, and the standard deviation over seeds at that step.

    Only steps at which every seed was evaluated take part: a mean over fewer seeds is another quantity. All NaN if
    there is none.
    """
    shared = ~np.isnan(returns).any(axis=0) if len(returns) else np.zeros(len(steps), dtype=bool)
    if not shared.any():
        return Maximum(np.nan, np.nan, np.nan)
    curve = mean_curve(returns[:, shared])
    at = int(np.argmax(curve.mean))
    return Maximum(float(curve.mean[at]), float(curve.std[at]), float(steps[shared][at]))


def mean_of_max(returns: Array) -> Maximum:
    """Mean over seeds of each seed's own maximum; it rewards noise and is never smaller than :func:`max_of_mean`."""
    measured = returns[~np.isnan(returns).all(axis=1)] if len(returns) else returns
    if not len(measured):
        return Maximum(np.nan, np.nan, np.nan)
    best = np.nanmax(measured, axis=1)
    return Maximum(float(best.mean()), float(best.std(ddof=1)) if len(best) > 1 else np.nan, np.nan)


def final_performance(steps: NDArray[np.int64], returns: Array, total_steps: int) -> Array:
    """Mean of each run's evaluations in the last 10% of its steps, ``0.9 * total < step <= total``: ``[seeds]``."""
    late = (10 * steps > 9 * total_steps) & (steps <= total_steps)
    return pd.DataFrame(returns[:, late]).mean(axis=1).to_numpy(float)


def hedges_g(a: Array, b: Array) -> float:
    """Difference of means over the root mean variance, times Hedges' small-sample factor ``1 - 3 / (4 df - 1)``.

    NaN where an arm has fewer than two seeds or nothing varies.
    """
    if min(len(a), len(b)) < 2:
        return np.nan
    scale = np.sqrt((a.var(ddof=1) + b.var(ddof=1)) / 2)
    if not scale > 0:
        return np.nan
    return float((a.mean() - b.mean()) / scale * (1 - 3 / (4 * (len(a) + len(b) - 2) - 1)))
