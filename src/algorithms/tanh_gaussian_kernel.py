"""The squashed Gaussian on the CPU and its gradient by hand, in Numba; the equations are those of :mod:`sac`.

With t = tanh(u), s = exp(log_std):  ``d log pi / du = 2 t``,  ``da / du = limit (1 - t^2)``,  ``du / d log_std = s n``.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache

import numpy as np
from numba import float32, void

from src.actors.kernels import compiled

_MATRIX, _ROW, _PAIR = float32[:, ::1], float32[::1], float32[:, :, ::1]
HALF_LOG_2PI, LOG_2 = np.float32(0.5 * math.log(2 * math.pi)), np.float32(math.log(2.0))
HALF, ONE, TWO, ZERO = np.float32(0.5), np.float32(1), np.float32(2), np.float32(0)


def _sample(mean, log_std, noise, bounds, action, log_probability, kept):  # type: ignore[no-untyped-def]
    """Fill action, log-probability ``[B]`` and what the gradient needs: t and s n; all others ``[B, M]``.

    ``bounds`` are lowest and highest log-std, and the limit of the action.
    """
    low, high, limit = bounds[0], bounds[1], bounds[2]
    for b in range(mean.shape[0]):
        total = ZERO
        for j in range(mean.shape[1]):
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
    grad_action, grad_log_probability, log_std, bounds, kept, grad_mean, grad_log_std
):
    """Fill the gradients to mean and log_std; none to a log_std out of its bounds."""
    low, high, limit = bounds[0], bounds[1], bounds[2]
    for b in range(log_std.shape[0]):
        for j in range(log_std.shape[1]):
            t, spread = kept[0, b, j], kept[1, b, j]
            g = grad_action[b, j] * limit * (ONE - t * t) + grad_log_probability[b] * TWO * t
            grad_mean[b, j] = g
            inside = low <= log_std[b, j] <= high
            grad_log_std[b, j] = g * spread - grad_log_probability[b] if inside else ZERO


@cache
def sample_kernel() -> Callable[..., None]:
    """The compiled sampling."""
    return compiled(_sample, void(_MATRIX, _MATRIX, _MATRIX, _ROW, _MATRIX, _ROW, _PAIR))


@cache
def gradient_kernel() -> Callable[..., None]:
    """The compiled gradient."""
    return compiled(_gradient, void(_MATRIX, _ROW, _MATRIX, _ROW, _PAIR, _MATRIX, _MATRIX))
