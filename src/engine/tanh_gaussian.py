"""SAC's squashed Gaussian (:func:`src.algorithms.sac.tanh_gaussian`) and its gradient by hand.

With t = tanh(u), s = exp(log_std):  ``d log pi / du = 2 t``,  ``da / du = limit (1 - t^2)``,  ``du / d log_std = s n``.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import torch
from numba import float32, int64, void
from torch import Tensor

from src.algorithms.sac import Bounds
from src.engine.jit import kernel
from src.engine.primitives import floats

HALF_LOG_2PI, LOG_2 = np.float32(0.5 * math.log(2 * math.pi)), np.float32(math.log(2.0))
HALF, ONE, TWO, ZERO = np.float32(0.5), np.float32(1), np.float32(2), np.float32(0)
_SIGNATURE = void(*5 * (int64,), float32, float32, float32, *3 * (int64,))


class Sample(NamedTuple):
    """Actions drawn from the policy, and what the gradient needs."""

    action: Tensor  # [B, M]
    log_probability: Tensor  # [B]
    log_std: Tensor  # [B, M], before it is clamped
    saved: Tensor  # [2, B, M]: t and s n


def sample(mean: Tensor, log_std: Tensor, noise: Tensor, bounds: Bounds) -> Sample:
    """A sample for mean, log-std and noise ``[B, M]``, contiguous float32."""
    samples, size = mean.shape
    found = Sample(mean.new_empty(samples, size), mean.new_empty(samples), log_std, mean.new_empty(2, samples, size))
    inputs = (mean.data_ptr(), log_std.data_ptr(), noise.data_ptr())
    results = (found.action.data_ptr(), found.log_probability.data_ptr(), found.saved.data_ptr())
    _sample(samples, size, *inputs, *bounds, *results)
    return found


def gradient(drawn: Sample, grad_action: Tensor, grad_log_probability: Tensor, bounds: Bounds) -> tuple[Tensor, Tensor]:
    """Gradients w.r.t. mean and log-std ``[B, M]`` from those w.r.t. action ``[B, M]`` and log-probability ``[B]``."""
    samples, size = drawn.action.shape
    grad_mean, grad_log_std = torch.empty_like(drawn.action), torch.empty_like(drawn.action)
    inputs = (grad_action.data_ptr(), grad_log_probability.data_ptr(), drawn.log_std.data_ptr())
    results = (drawn.saved.data_ptr(), grad_mean.data_ptr(), grad_log_std.data_ptr())
    _gradient(samples, size, *inputs, *bounds, *results)
    return grad_mean, grad_log_std


@kernel(_SIGNATURE)
def _sample(  # type: ignore[no-untyped-def]
    samples, size, mean, log_std, noise, low, high, limit, action, log_probability, saved
):
    """Fill action, log-probability ``[B]`` and what the gradient needs: t and s n; all others ``[B, M]``, by address.

    ``low`` and ``high`` bound the log-std, ``limit`` the action.
    """
    shape = (samples, size)
    mean, log_std = floats(mean, shape), floats(log_std, shape)
    noise, action = floats(noise, shape), floats(action, shape)
    log_probability, saved = floats(log_probability, (samples,)), floats(saved, (2, samples, size))
    for b in range(samples):
        total = ZERO
        for j in range(size):
            n, own = noise[b, j], log_std[b, j]
            own = low if own < low else (high if own > high else own)  # NaN propagates
            scaled_noise = np.exp(own) * n
            u = mean[b, j] + scaled_noise
            squashed = np.tanh(u)
            saved[0, b, j], saved[1, b, j] = squashed, scaled_noise
            action[b, j] = squashed * limit
            softplus = max(-TWO * u, ZERO) + np.log1p(np.exp(-abs(TWO * u)))
            total += -HALF * n * n - own - HALF_LOG_2PI - TWO * (LOG_2 - u - softplus)
        log_probability[b] = total


@kernel(_SIGNATURE)
def _gradient(  # type: ignore[no-untyped-def]
    samples, size, grad_action, grad_log_probability, log_std, low, high, limit, saved, grad_mean, grad_log_std
):
    """Fill the gradients w.r.t. mean and log_std; none for a log_std out of its bounds. Arrays come by address."""
    shape = (samples, size)
    grad_action, log_std = floats(grad_action, shape), floats(log_std, shape)
    grad_mean, grad_log_std = floats(grad_mean, shape), floats(grad_log_std, shape)
    grad_log_probability = floats(grad_log_probability, (samples,))
    saved = floats(saved, (2, samples, size))
    for b in range(samples):
        for j in range(size):
            t, scaled_noise = saved[0, b, j], saved[1, b, j]
            g = grad_action[b, j] * limit * (ONE - t * t) + grad_log_probability[b] * TWO * t
            grad_mean[b, j] = g
            inside = low <= log_std[b, j] <= high
            grad_log_std[b, j] = g * scaled_noise - grad_log_probability[b] if inside else ZERO
