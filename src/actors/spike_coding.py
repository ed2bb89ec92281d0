"""Spike coding: from stimulation strength to spike trains [P, Poisson coding, Deterministic coding].

Deterministic, over tau = 1..T from v' = 0::

    v' += A;   spike if v' > theta;   v' -= theta where it spiked          (theta = 0.999)

Poisson: ``spike_tau ~ Bernoulli(A)`` independently per step: 1 where ``u < A``, u uniform in [0, 1) by
:mod:`src.actors.philox` from a key that is one draw from the generator.

The gradient is straight through: Poisson ``d spike_tau / d A = 1``; deterministic ``d spike_tau / d v'_tau = 1``, not
detached through the soft reset, so ``d spike_tau / d A = a_tau`` with ``a_1 = 1, a_(tau+1) = (1 - theta) a_tau + 1``.
Neither depends on data: ``grad_A = sum over tau of a_tau * grad_spike_tau``.

Analog: no spikes; every step receives A itself [MDC-SAN].
"""

from __future__ import annotations

from typing import Any, Literal

import torch
from torch import Tensor

from src.actors.philox import draw_key, uniform

Coding = Literal["poisson", "deterministic", "analog"]


def encode(
    strength: Tensor, coding: Coding, time_steps: int, threshold: float, generator: torch.Generator | None
) -> Tensor:
    """Spike trains, with straight-through gradient w.r.t. the strength.

    Args:
        strength: stimulation strength A, ``[B, n]``, in [0, 1].
        coding: poisson, deterministic or analog.
        time_steps: T.
        threshold: of the deterministic coding.
        generator: the stream that Poisson coding draws one key from.

    Returns:
        Spikes, ``[T, B, n]``, 0 or 1, of the dtype of ``strength``; analog: the strength of every step.

    Raises:
        ValueError: Poisson coding without a generator.
    """
    if coding == "analog":
        return strength.expand(time_steps, *strength.shape)
    if coding == "poisson":
        spikes = poisson_spikes(strength.detach(), time_steps, generator)
    else:
        spikes = deterministic_spikes(strength.detach(), time_steps, threshold)
    gradient = coding_gradient(coding, time_steps, threshold)
    coded: Tensor = StraightThrough.apply(strength, spikes, gradient)  # type: ignore[no-untyped-call]
    return coded


def poisson_spikes(strength: Tensor, time_steps: int, generator: torch.Generator | None) -> Tensor:
    """``1[u < A]``, ``[B, n] -> [T, B, n]``; raises ValueError without a generator."""
    return (poisson_draws(strength, time_steps, generator) < strength).to(strength.dtype)


def poisson_draws(strength: Tensor, time_steps: int, generator: torch.Generator | None) -> Tensor:
    """The uniform numbers of Poisson coding, ``[T, B, n]``; raises ValueError without a generator."""
    if generator is None:
        raise ValueError("Poisson coding draws random spikes: call the actor with generator=...")
    draws = uniform(draw_key(generator), time_steps, strength.numel(), strength.device)
    return draws.view(time_steps, *strength.shape)


def deterministic_spikes(strength: Tensor, time_steps: int, threshold: float) -> Tensor:
    """An integrate-and-fire neuron with soft reset for each strength, ``[B, n] -> [T, B, n]``."""
    voltage = torch.zeros_like(strength)
    spikes = []
    for _ in range(time_steps):
        voltage = voltage + strength
        spikes.append((voltage > threshold).to(strength.dtype))
        voltage = voltage - threshold * spikes[-1]
    return torch.stack(spikes)


def coding_gradient(coding: Coding, time_steps: int, threshold: float) -> list[float]:
    """``a_tau = d spike_tau / d A`` for tau = 1..T."""
    if coding == "poisson":
        return [1.0] * time_steps
    gradient = [1.0]
    while len(gradient) < time_steps:
        gradient.append((1.0 - threshold) * gradient[-1] + 1.0)
    return gradient


class StraightThrough(torch.autograd.Function):
    """Spikes as they are; the gradient w.r.t. the strength is ``sum over tau of a_tau * grad_spike_tau``."""

    @staticmethod
    def forward(ctx: Any, strength: Tensor, spikes: Tensor, coding_gradient: list[float]) -> Tensor:
        """Spikes ``[T, B, n]`` of a strength ``[B, n]``."""
        ctx.coding_gradient = coding_gradient
        return spikes.view_as(spikes)

    @staticmethod
    def backward(ctx: Any, *grads: Tensor) -> tuple[Tensor, None, None]:
        """From ``[T, B, n]`` to ``[B, n]``."""
        (grad_spikes,) = grads
        a = grad_spikes.new_tensor(ctx.coding_gradient)
        return torch.tensordot(a, grad_spikes, dims=1), None, None
