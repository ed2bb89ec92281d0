"""Arms whose seeds fall into two groups, such as runs that failed and runs that did not: their means mislead."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from analysis.hypothesis_tests import TEST_SEEDS

Array = NDArray[np.float64]
#: Of normal samples of ``n`` seeds, the largest gap exceeds this over ``sqrt(n)`` of the range in about 6 of 100.
GAP = 1.55
TIMES_SMALLEST_EFFECT = 2.0


def bimodal(scores: Array, smallest_effect: float) -> bool:
    """Whether one gap between neighbouring scores ``[seeds]`` (normalised) splits them; never below 5 seeds.

    The gap is wider than normal samples have it and wider than twice the smallest relevant effect.
    """
    if len(scores) < TEST_SEEDS:
        return False
    ordered = np.sort(scores)
    gap, spread = float(np.diff(ordered).max()), float(ordered[-1] - ordered[0])
    return gap > GAP / len(scores) ** 0.5 * spread and gap > TIMES_SMALLEST_EFFECT * smallest_effect


def share_below_half(scores: Array) -> float:
    """Share of seeds below half of the reference score, of normalised scores ``[seeds]``; NaN without seeds."""
    return float((scores < 50.0).mean()) if len(scores) else float("nan")
