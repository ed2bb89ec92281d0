"""Deterministic spike coding on the CPU, in Numba; the equations are those of :mod:`src.actors.spike_coding`."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
from numba import float32, void

from src.actors.kernels import compiled

ZERO, ONE = np.float32(0), np.float32(1)
BLOCK = 512  # neurons whose voltages stay in the first-level cache over all steps


def _deterministic(strength, threshold, spikes):  # type: ignore[no-untyped-def]
    """Fill ``spikes [T, n]`` from ``strength [n]``."""
    voltage = np.empty(BLOCK, np.float32)
    for start in range(0, strength.shape[0], BLOCK):
        block = strength[start : start + BLOCK]
        for i in range(BLOCK):
            voltage[i] = ZERO
        for t in range(spikes.shape[0]):
            train = spikes[t, start : start + BLOCK]
            for i in range(block.shape[0]):
                v = voltage[i] + block[i]
                spike = ONE if v > threshold else ZERO
                train[i] = spike
                voltage[i] = v - threshold * spike


@cache
def deterministic_kernel() -> Callable[..., None]:
    """The compiled coding: arguments strength, threshold, spikes (filled)."""
    return compiled(_deterministic, void(float32[::1], float32, float32[:, ::1]))
