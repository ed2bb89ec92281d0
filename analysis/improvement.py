"""Probability of improvement, by rliable, for arms whose tasks may have unequal numbers of seeds."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from rliable import metrics as rliable_metrics

Array = NDArray[np.float64]


def probability_of_improvement(x: Sequence[Array], y: Sequence[Array]) -> float:
    """P(a seed of X beats a seed of Y), ties half, averaged over tasks; one array ``[seeds]`` per task (Agarwal et
    al. 2021).
    """
    values = [
        float(rliable_metrics.probability_of_improvement(np.asarray(a)[:, None], np.asarray(b)[:, None]))
        for a, b in zip(x, y, strict=True)
    ]
    return float(np.mean(values))
