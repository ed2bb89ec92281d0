"""The squashed Gaussian on the CPU and its gradient by hand, in Numba; the equations are those of :mod:`sac`.

With t = tanh(u), s = exp(log_std):  ``d log pi / du = 2 t``,  ``da / du = limit (1 - t^2)``,  ``du / d log_std = s n``.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache

import numpy as np
from numba import carray, float32, int64, void

from src.actors.kernels import compiled, floats_at

_BOUNDS = (float32, float32, float32)
HALF_LOG_2PI, LOG_2 = np.float32(0.5 * math.log(2 * math.pi)), np.float32(math.log(2.0))
HALF, ONE, TWO, ZERO = np.float32(0.5), np.float32(1), np.float32(2), np.float32(0)


def _sample(  # type: ignore[no-untyped-def]
    samples, size, mean, log_std, noise, low, high, limit, action, log_probability, kept
):
    """Fill action, log-probability ``[B]`` and what the gradient needs: t and s n; all others ``[B, M]``, by address.

    ``low`` and ``high`` bound the log-std, ``limit`` the action.
    """
    shape = (samples, size)
    mean, log_std = carray(floats_at(mean), shape), carray(floats_at(log_std), shape)
    noise, action = carray(floats_at(noise), shape), carray(floats_at(action), shape)
    log_probability, kept = carray(floats_at(log_probability), (samples,)), carray(floats_at(kept), (2, samples, size))
    for b in range(samples):
        total = ZERO
        for j in range(size):
            n, own = noise[b, j], log_std[b, j]
            own = low if own < low else (high if own > high else own)  # what is not a number stays so
            spread = np.exp(own) * n
            u = mean[b, j] + spread
            squashed = np.tanh(u)
            kept[0, b, j], kept[1, b, j] = squashed, spread
            action[b, j] = squashed * limit
            softplus = max(-TWO * u, ZERO) + np.log1p(np.exp(-abs(TWO * u)))
            total += -HALF * n * n - own - HALF_LOG_2PI - TWO * (LOG_2 - u - softplus)
        log_probability[b] = total


def _gradient(  # type: ignore[no-untyped-def]
    samples, size, grad_action, grad_log_probability, log_std, low, high, limit, kept, grad_mean, grad_log_std
):
    """Fill the gradients to mean and log_std; none to a log_std out of its bounds. Arrays come by address."""
    shape = (samples, size)
    grad_action, log_std = carray(floats_at(grad_action), shape), carray(floats_at(log_std), shape)
    grad_mean, grad_log_std = carray(floats_at(grad_mean), shape), carray(floats_at(grad_log_std), shape)
    grad_log_probability = carray(floats_at(grad_log_probability), (samples,))
    kept = carray(floats_at(kept), (2, samples, size))
    for b in range(samples):
        for j in range(size):
            t, spread = kept[0, b, j], kept[1, b, j]
            g = grad_action[b, j] * limit * (ONE - t * t) + grad_log_probability[b] * TWO * t
            grad_mean[b, j] = g
            inside = low <= log_std[b, j] <= high
            grad_log_std[b, j] = g * spread - grad_log_probability[b] if inside else ZERO


@cache
def sample_kernel() -> Callable[..., None]:
    """The compiled sampling."""
    return compiled(_sample, void(*5 * (int64,), *_BOUNDS, *3 * (int64,)))


@cache
def gradient_kernel() -> Callable[..., None]:
    """The compiled gradient."""
    return compiled(_gradient, void(*5 * (int64,), *_BOUNDS, *3 * (int64,)))
