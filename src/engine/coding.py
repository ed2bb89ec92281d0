"""Receptive fields and spike coding: :mod:`src.actors.population_encoder` and :mod:`src.actors.spike_coding`.

The exponential is PyTorch's, so that strengths are its own bit for bit. Poisson coding's numbers are those of
:mod:`src.actors.philox`. Constants are repeated here: the cache of machine code goes by the engine's sources alone.
"""

from __future__ import annotations

import numpy as np
from numba import float32, int64, uint64, void

from src.engine.jit import kernel
from src.engine.primitives import floats

ZERO, ONE, MINUS_HALF = np.float32(0), np.float32(1), np.float32(-0.5)
LOWEST = np.float32(-87.33655)  # the largest exponent whose exponential is denormal
UNDERFLOW_MARK = np.float32(1)  # stands for exponents up to there; no other is positive
TWO_TO_MINUS_24 = np.float32(2.0**-24)
M0, M1, W0, W1 = (np.uint64(word) for word in (0xD2511F53, 0xCD9E8D57, 0x9E3779B9, 0xBB67AE85))
MASK, HALF, NONE, EIGHT = np.uint64(0xFFFFFFFF), np.uint64(32), np.uint64(0), np.uint32(8)
BLOCK = 512  # neurons, or counters, whose state stays in the first-level cache


@kernel(void(int64, int64, int64, float32, int64))
def deterministic_spikes(steps, n, strength, threshold, spikes):  # type: ignore[no-untyped-def]
    """Fill ``spikes [T, n]`` from ``strength [n]``, given by their addresses."""
    strength, spikes = floats(strength, (n,)), floats(spikes, (steps, n))
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


@kernel(void(int64, int64, int64, uint64, int64))
def poisson_spikes(steps, n, strength, key, spikes):  # type: ignore[no-untyped-def]
    """Fill ``spikes [T, n]`` from ``strength [n]``, given by their addresses: ``1[u < A]``."""
    strength, spikes = floats(strength, (n,)), floats(spikes, (steps, n))
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


@kernel(void(*8 * (int64,)))
def field_exponents(samples, inputs, fields, observation, mean, std, distance, exponent):  # type: ignore[no-untyped-def]
    """Fill ``s - mu`` and ``-(s - mu)^2 / (2 sigma^2)``, ``[B, N, J]``, from ``[B, N]`` and twice ``[N, J]``, given by
    their addresses.

    Exponents up to LOWEST become UNDERFLOW_MARK: an exponential that underflows would take fifty times as long.
    """
    observation = floats(observation, (samples, inputs))
    mean, std = floats(mean, (inputs, fields)), floats(std, (inputs, fields))
    distance = floats(distance, (samples, inputs, fields))
    exponent = floats(exponent, (samples, inputs, fields))
    factor = np.empty(mean.shape, np.float32)
    for i in range(mean.shape[0]):
        for j in range(mean.shape[1]):
            factor[i, j] = MINUS_HALF / (std[i, j] * std[i, j])
    for b in range(observation.shape[0]):
        for i in range(mean.shape[0]):
            s = observation[b, i]
            for j in range(mean.shape[1]):
                d = s - mean[i, j]
                distance[b, i, j] = d
                e = d * d * factor[i, j]
                exponent[b, i, j] = UNDERFLOW_MARK if e <= LOWEST else e  # NaN propagates


@kernel(void(int64, int64))
def zero_underflow(n, strength):  # type: ignore[no-untyped-def]
    """Strengths of exponents up to LOWEST, which now are those above 1, are 0; an address and how many."""
    strength = floats(strength, (n,))
    for i in range(n):
        value = strength[i]
        strength[i] = ZERO if value > ONE else value
