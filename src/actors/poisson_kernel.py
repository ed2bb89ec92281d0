"""Poisson coding on the CPU, in Numba: the numbers are those of :mod:`src.actors.philox`, bit for bit."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
from numba import carray, int64, uint64, void

from src.actors.kernels import compiled, floats_at

ZERO, ONE, TWO_TO_MINUS_24 = np.float32(0), np.float32(1), np.float32(2.0**-24)
M0, M1, W0, W1 = (np.uint64(word) for word in (0xD2511F53, 0xCD9E8D57, 0x9E3779B9, 0xBB67AE85))
MASK, HALF, NONE, EIGHT = np.uint64(0xFFFFFFFF), np.uint64(32), np.uint64(0), np.uint32(8)
BLOCK = 512  # counters whose words stay in the first-level cache


def _poisson(steps, n, strength, key, spikes):  # type: ignore[no-untyped-def]
    """Fill ``spikes [T, n]`` from ``strength [n]``, given by their addresses: ``1[u < A]``."""
    strength, spikes = carray(floats_at(strength), (n,)), carray(floats_at(spikes), (steps, n))
    words = np.empty((4, BLOCK), np.uint32)
    quarter = (n + 3) // 4
    for t in range(steps):
        for start in range(0, quarter, BLOCK):
            size = min(BLOCK, quarter - start)
            for i in range(size):
                c0, c1, c2, c3 = np.uint64(start + i), np.uint64(t), NONE, NONE
                k0, k1 = key & MASK, key >> HALF
                for _ in range(10):
                    p0, p1 = M0 * c0, M1 * c2
                    c0, c1, c2, c3 = (p1 >> HALF) ^ c1 ^ k0, p1 & MASK, (p0 >> HALF) ^ c3 ^ k1, p0 & MASK
                    k0, k1 = (k0 + W0) & MASK, (k1 + W1) & MASK
                words[0, i], words[1, i], words[2, i], words[3, i] = c0, c1, c2, c3
            for w in range(4):
                begin = w * quarter + start
                source, train, row = strength[begin:], spikes[t, begin:], words[w]
                for i in range(min(size, n - begin)):
                    u = np.float32(np.int32(row[i] >> EIGHT)) * TWO_TO_MINUS_24
                    a = source[i]  # loaded unconditionally, or the loop is not SIMD
                    train[i] = ONE if u < a else ZERO


@cache
def poisson_kernel() -> Callable[..., None]:
    """The compiled coding: arguments T, n, the address of the strength, key, that of the spikes (filled)."""
    return compiled(_poisson, void(int64, int64, int64, uint64, int64))
