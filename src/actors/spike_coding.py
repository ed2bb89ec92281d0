"""Spike coding: from stimulation strength to spike trains [P, Poisson coding, Deterministic coding].

Deterministic, over tau = 1..T from v' = 0::

    v' += A;   spike if v' > theta;   v' -= theta where it spiked          (theta = 0.999)

Poisson: ``spike_tau ~ Bernoulli(A)`` independently per step: 1 where ``u < A``, u uniform in [0, 1) by
:mod:`src.actors.philox` from a key that is one draw from the generator.

The gradient is straight through: poisson ``d spike_tau / d A = 1``; deterministic ``d spike_tau / d v'_tau = 1``, not
detached through the soft reset, so ``d spike_tau / d A = a_tau`` with ``a_1 = 1, a_(tau+1) = (1 - theta) a_tau + 1``.
Both depend on no data: ``grad_A = sum over tau of a_tau * grad_spike_tau``.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
import torch
from torch import Tensor

from src.actors.coding_kernel import deterministic_kernel
from src.actors.kernels import takes_kernel
from src.actors.philox import draw_key, uniform
from src.actors.poisson_kernel import poisson_kernel

Coding = Literal["poisson", "deterministic"]


def encode(
    strength: Tensor,
    coding: Coding,
    time_steps: int,
    threshold: float,
    generator: torch.Generator | None,
    out: Tensor | None = None,
) -> Tensor:
    """Spike trains without gradient.

    Args:
        strength: stimulation strength A, ``[B, n]``, in (0, 1].
        coding: poisson or deterministic.
        time_steps: T.
        threshold: of the deterministic coding.
        generator: the stream that Poisson coding draws one key from.
        out: where the spikes go, contiguous; by default a new tensor.

    Returns:
        Spikes, ``[T, B, n]``, 0 or 1, of the dtype of ``strength``.

    Raises:
        ValueError: Poisson coding without a generator.
    """
    strength = strength.detach()
    spikes = strength.new_empty((time_steps, *strength.shape)) if out is None else out
    if coding == "deterministic":
        return deterministic_spikes(strength, threshold, spikes)
    if not takes_kernel(strength):
        return torch.lt(poisson_draws(strength, time_steps, generator), strength, out=spikes)
    strength = strength.contiguous()
    poisson_kernel()(time_steps, strength.numel(), strength.data_ptr(), _key(generator), spikes.data_ptr())
    return spikes


def poisson_draws(strength: Tensor, time_steps: int, generator: torch.Generator | None) -> Tensor:
    """The uniform numbers of Poisson coding, ``[T, B, n]``; raises ValueError without a generator."""
    draws = uniform(_key(generator), time_steps, strength.numel(), strength.device)
    return draws.to(strength.dtype).view(time_steps, *strength.shape)


def _key(generator: torch.Generator | None) -> int:
    if generator is None:
        raise ValueError("Poisson coding draws random spikes: call the actor with generator=...")
    return draw_key(generator)


def deterministic_spikes(strength: Tensor, threshold: float, spikes: Tensor) -> Tensor:
    """Fill deterministic spike trains ``[T, B, n]`` of a strength ``[B, n]``."""
    if takes_kernel(strength):
        train = spikes.view(len(spikes), -1).numpy()
        deterministic_kernel()(strength.contiguous().view(-1).numpy(), np.float32(threshold), train)
        return spikes
    voltage = torch.zeros_like(strength)
    for train in spikes:
        voltage = voltage + strength
        torch.gt(voltage, threshold, out=train)
        voltage = voltage - threshold * train
    return spikes


def coding_gradient(coding: Coding, time_steps: int, threshold: float) -> list[float]:
    """``a_tau = d spike_tau / d A`` for tau = 1..T."""
    if coding == "poisson":
        return [1.0] * time_steps
    gradient = [1.0]
    while len(gradient) < time_steps:
        gradient.append((1.0 - threshold) * gradient[-1] + 1.0)
    return gradient


class StraightThroughSpikes(torch.autograd.Function):
    """:func:`encode` with its straight-through gradient."""

    @staticmethod
    def forward(
        ctx: torch.autograd.function.FunctionCtx,
        strength: Tensor,
        coding: Coding,
        time_steps: int,
        threshold: float,
        generator: torch.Generator | None,
    ) -> Tensor:
        """Spikes ``[T, B, n]``."""
        ctx.coefficients = coding_gradient(coding, time_steps, threshold)  # type: ignore[attr-defined]
        return encode(strength, coding, time_steps, threshold, generator)

    @staticmethod
    def backward(ctx: torch.autograd.function.FunctionCtx, *grads: Tensor) -> tuple[Tensor, None, None, None, None]:
        """Sum over tau of ``a_tau * grad_spike_tau``."""
        (grad_spikes,) = grads
        coefficients = grad_spikes.new_tensor(ctx.coefficients)  # type: ignore[attr-defined]
        return torch.tensordot(coefficients, grad_spikes, dims=1), None, None, None, None
