"""The spiking layer: current-based leaky integrate-and-fire neurons, dendritic max and lateral interaction [P].

For tau = 1..T, all states 0 before tau = 1 at every decision::

    x_tau = max over branches of z_tau + bias                                  Inter
    c_tau = d_c * c_(tau-1) + x_tau
    v_tau = d_v * v_(tau-1) * (1 - o_(tau-1)) + c_tau + sum_k w'_k o_(tau-1),k    Intra
    o_tau = 1 if v_tau > v_th else 0                                           hard reset to 0

Surrogate gradient: ``do/dv = 1 where |v - v_th| < w`` (strict), else 0. This module is the specification, in plain
PyTorch, one step after the other; :mod:`src.actors.lif_op` computes the same, fused.
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


class Fire(torch.autograd.Function):
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


def maxout(currents: Tensor) -> tuple[Tensor, Tensor]:
    """Max over dendritic branches; of equal branches the first wins, and takes the gradient.

    Args:
        currents: ``[B, d, n]``.

    Returns:
        The largest branch current ``[B, n]`` and its index ``[B, n]``, int8.
    """
    largest = currents[:, 0]
    branch = torch.zeros_like(largest, dtype=torch.int8)
    for index in range(1, currents.shape[1]):
        larger = currents[:, index] > largest
        largest = torch.where(larger, currents[:, index], largest)
        branch = torch.where(larger, torch.full_like(branch, index), branch)
    return largest, branch


def lif_step(
    x: Tensor,
    state: tuple[Tensor, Tensor, Tensor],
    lateral: Tensor | None,
    offsets: Sequence[int],
    constants: LIFConstants,
) -> tuple[Tensor, Tensor, Tensor]:
    """One step of the equations above.

    Args:
        x: input current with bias, ``[B, n]``.
        state: ``(c, v, o)`` of the step before, ``[B, n]`` each.
        lateral: ``w'``, ``[K, n]``, or None.
        offsets: index distance of each of the K neighbours.
        constants: of the neurons.

    Returns:
        ``(c, v, o)`` of this step.
    """
    c, v, o = state
    reset = o if constants.reset_gradient else o.detach()
    c = constants.current_decay * c + x
    v = constants.voltage_decay * v * (1.0 - reset) + c
    if lateral is not None:
        radius = max(abs(offset) for offset in offsets)
        neighbours = F.pad(o if constants.lateral_gradient else o.detach(), (radius, radius))
        for row, offset in enumerate(offsets):
            start = radius + offset
            v = v + lateral[row] * neighbours[:, start : start + o.shape[1]]
    return c, v, Fire.apply(v, constants.threshold, constants.window)  # type: ignore[no-untyped-call]


def lif_reference(
    currents: Tensor,
    bias: Tensor | None,
    lateral: Tensor | None,
    offsets: Sequence[int],
    branches: int,
    constants: LIFConstants,
) -> tuple[Tensor, Tensor, Tensor]:
    """All T steps of a layer, differentiable by autograd.

    Args:
        currents: z, the branch currents, ``[T, B, d*n]``, branch by branch.
        bias: of the neurons, ``[n]``, added after the max, or None.
        lateral: ``w'``, ``[K, n]``, or None.
        offsets: index distance of each of the K neighbours.
        branches: d.
        constants: of the neurons.

    Returns:
        Spikes ``[T, B, n]``, membrane potentials ``[T, B, n]`` (before the reset) and the index of the largest branch
        ``[T, B, n]``, int8.
    """
    dendrites = currents.unflatten(-1, (branches, -1))
    zeros = torch.zeros_like(dendrites[0, :, 0])
    state = (zeros, zeros, zeros)
    spikes, potentials, winners = [], [], []
    for step in range(currents.shape[0]):
        largest, branch = maxout(dendrites[step])
        x = largest if bias is None else largest + bias
        state = lif_step(x, state, lateral, offsets, constants)
        spikes.append(state[2])
        potentials.append(state[1])
        winners.append(branch)
    return torch.stack(spikes), torch.stack(potentials), torch.stack(winners)
