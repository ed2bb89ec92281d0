"""The time steps of a layer, whatever its neurons: the step before feeds the next."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import torch
from torch import Tensor


def run_steps(
    x: Tensor, rest: Any, step: Callable[[Tensor, Any], Any], feedback: Callable[[Tensor], Tensor] | None = None
) -> tuple[Tensor, Tensor]:
    """All T steps of a layer.

    Args:
        x: input currents, ``[T, B, n]``.
        rest: the neurons' state before the first step; a state has ``spikes`` and ``potential``, ``[B, n]`` each.
        step: from ``x_tau`` and the state before it to the state after it.
        feedback: from the layer's own spikes of the step before to what they add to ``x_tau``, ``[B, n] -> [B, n]``.

    Returns:
        Spikes and membrane potentials (before the reset), ``[T, B, n]`` each.
    """
    state = rest
    spikes, potentials = [], []
    for x_tau in x:
        if feedback is not None:
            x_tau = x_tau + feedback(state.spikes)
        state = step(x_tau, state)
        spikes.append(state.spikes)
        potentials.append(state.potential)
    return torch.stack(spikes), torch.stack(potentials)
