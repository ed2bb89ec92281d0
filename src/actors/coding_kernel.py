"""Receptive fields and deterministic spike coding on the CPU, in Numba.

The equations are those of :mod:`src.actors.population_encoder` and :mod:`src.actors.spike_coding`; the exponential is
left to PyTorch.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
from numba import carray, float32, int64, void

from src.actors.kernels import compiled, floats_at

ZERO, ONE, MINUS_HALF = np.float32(0), np.float32(1), np.float32(-0.5)
LOWEST = np.float32(-87.33655)  # the largest number whose exponential is denormal
FAR = np.float32(1)  # stands for exponents up to there; no other is positive
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


def _exponent(samples, inputs, fields, observation, mean, std, distance, exponent):  # type: ignore[no-untyped-def]
    """Fill ``s - mu`` and ``-(s - mu)^2 / (2 sigma^2)``, ``[B, N, J]``, from ``[B, N]`` and twice ``[N, J]``, given by
    their addresses.

    Exponents up to LOWEST become FAR: an exponential that underflows would take fifty times as long.
    """
    observation = carray(floats_at(observation), (samples, inputs))
    mean, std = carray(floats_at(mean), (inputs, fields)), carray(floats_at(std), (inputs, fields))
    distance = carray(floats_at(distance), (samples, inputs, fields))
    exponent = carray(floats_at(exponent), (samples, inputs, fields))
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
                exponent[b, i, j] = FAR if e <= LOWEST else e  # what is not a number stays so


def _underflow(n, strength):  # type: ignore[no-untyped-def]
    """Strengths of exponents up to LOWEST, which now are those above 1, are 0; an address and how many."""
    strength = carray(floats_at(strength), (n,))
    for i in range(n):
        value = strength[i]
        strength[i] = ZERO if value > ONE else value


@cache
def exponent_kernel() -> Callable[..., None]:
    """The compiled receptive fields, but for the exponential."""
    return compiled(_exponent, void(*8 * (int64,)))


@cache
def underflow_kernel() -> Callable[..., None]:
    """The compiled correction of underflow: arguments how many, and the address of the strength (corrected)."""
    return compiled(_underflow, void(int64, int64))


@cache
def deterministic_kernel() -> Callable[..., None]:
    """The compiled coding: arguments strength, threshold, spikes (filled)."""
    return compiled(_deterministic, void(float32[::1], float32, float32[:, ::1]))
