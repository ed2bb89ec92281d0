"""Spreading weights over dendritic branches and gathering their gradient on the CPU, in Numba: one pass over each."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
from numba import float32, int8, void

from src.actors.kernels import compiled

ZERO = np.float32(0)
_SIGNATURE = void(float32[:, ::1], int8[:, ::1], float32[:, :, ::1])


def _spread(weight, branch, spread):  # type: ignore[no-untyped-def]
    """``spread[m] = weight where branch == m, else 0``; shapes ``[n, inputs]``, ``[n, inputs]``, ``[d, n, inputs]``."""
    for m in range(spread.shape[0]):
        for j in range(weight.shape[0]):
            source, own, target = weight[j], branch[j], spread[m, j]
            for i in range(source.shape[0]):
                value = source[i]  # loaded unconditionally, or the loop is not SIMD
                target[i] = value if own[i] == np.int8(m) else ZERO


def _gather(gathered, branch, spread):  # type: ignore[no-untyped-def]
    """``gathered = spread[m] where branch == m``; shapes as for spreading."""
    for j in range(gathered.shape[0]):
        own, target = branch[j], gathered[j]
        for m in range(spread.shape[0]):
            source = spread[m, j]
            for i in range(target.shape[0]):
                value, others = source[i], target[i]
                target[i] = value if own[i] == np.int8(m) else others


@cache
def spread_kernel() -> Callable[..., None]:
    """The compiled spreading: arguments weight, branch, spread (filled)."""
    return compiled(_spread, _SIGNATURE)


@cache
def gather_kernel() -> Callable[..., None]:
    """The compiled gathering: arguments gathered (filled), branch, spread."""
    return compiled(_gather, _SIGNATURE)
