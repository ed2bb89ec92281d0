"""Current-based leaky integrate-and-fire neurons with lateral interaction [P].

For tau = 1..T, all states 0 before tau = 1 at every decision::

    c_tau = d_c * c_(tau-1) + x_tau                                             x: Inter (src/actors/synapse.py)
    v_tau = d_v * v_(tau-1) * (1 - o_(tau-1)) + c_tau + sum_k w'_k o_(tau-1),k  sum: Intra (src/actors/lateral.py)
    o_tau = 1 if v_tau > v_th else 0                                            hard reset to 0

Surrogate gradient: ``do/dv = 1 where |v - v_th| < w`` (strict), else 0.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import torch
from torch import Tensor
from torch.nn import functional as F


class LIFConstants(NamedTuple):
    """Constants of a layer's neurons."""

    current_decay: float  # d_c
    voltage_decay: float  # d_v
    threshold: float  # v_th
    window: float  # w of the surrogate gradient
    reset_gradient: bool  # the reset's factor (1 - o) carries gradient
    lateral_gradient: bool  # the lateral term carries gradient back to the neighbours' spikes


class LIFState(NamedTuple):
    """State of a layer's neurons after a step, ``[B, n]`` each."""

    current: Tensor  # c
    potential: Tensor  # v, the membrane potential before the reset
    spikes: Tensor  # o

    @classmethod
    def rest(cls, x: Tensor) -> LIFState:
        """Before the first step, for input currents like ``x``."""
        zeros = torch.zeros_like(x)
        return cls(zeros, zeros, zeros)


class SpikeSurrogate(torch.autograd.Function):
    """``o = 1 if v > v_th else 0`` with the rectangular surrogate gradient."""

    @staticmethod
    def forward(ctx: Any, membrane_potential: Tensor, threshold: float, window: float) -> Tensor:
        """Spikes of the shape and dtype of the membrane potential."""
        ctx.save_for_backward(membrane_potential)
        ctx.threshold, ctx.window = threshold, window
        return (membrane_potential > threshold).to(membrane_potential.dtype)

    @staticmethod
    def backward(ctx: Any, *grads: Tensor) -> tuple[Tensor, None, None]:
        """``grad * 1[|v - v_th| < w]``."""
        (membrane_potential,) = ctx.saved_tensors
        inside = (membrane_potential - ctx.threshold).abs() < ctx.window
        return grads[0] * inside, None, None


def lateral_terms(spikes: Tensor, weight: Tensor, offsets: Sequence[int]) -> list[Tensor]:
    """``w'_k o_k`` for each of the K neighbours, ``[B, n]``; beyond the ends of the line nothing spikes.

    Args:
        spikes: of the step before, ``[B, n]``.
        weight: ``w'``, ``[K, n]``.
        offsets: index distance of each neighbour.
    """
    neurons = spikes.shape[1]
    radius = max(abs(offset) for offset in offsets)
    padded = F.pad(spikes, (radius, radius))
    starts = [radius + offset for offset in offsets]
    return [row * padded[:, start : start + neurons] for row, start in zip(weight, starts, strict=True)]


def lif_step(
    x: Tensor, state: LIFState, lateral: Tensor | None, offsets: Sequence[int], constants: LIFConstants
) -> LIFState:
    """One step of the equations above.

    Args:
        x: input current, ``[B, n]``.
        state: of the step before.
        lateral: ``w'``, ``[K, n]``, or None.
        offsets: index distance of each of the K neighbours.
        constants: of the neurons.
    """
    reset = state.spikes if constants.reset_gradient else state.spikes.detach()
    current = constants.current_decay * state.current + x
    potential = constants.voltage_decay * state.potential * (1.0 - reset) + current
    if lateral is not None:
        neighbours = state.spikes if constants.lateral_gradient else state.spikes.detach()
        for term in lateral_terms(neighbours, lateral, offsets):
            potential = potential + term
    spikes: Tensor = SpikeSurrogate.apply(potential, constants.threshold, constants.window)  # type: ignore[no-untyped-call]
    return LIFState(current, potential, spikes)
