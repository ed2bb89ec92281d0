"""Spiking health: does the surrogate gradient still find neurons to pass through?

Spiking actors fail by saturation: membrane potentials drift far above the threshold, no neuron stays inside the
surrogate's window, the gradient is zero and the return freezes.
"""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor


class Activity(NamedTuple):
    """The spikes and membrane potentials of one pass of a spiking actor."""

    input_spikes: Tensor  # of the encoder, [T, B, N*J]
    layers: list[tuple[Tensor, Tensor]]  # spikes and membrane potentials of each layer, [T, B, n]

    @property
    def output_spikes(self) -> Tensor:
        """Spikes of the output population, ``[T, B, M*P]``."""
        return self.layers[-1][0]


class LayerHealth(NamedTuple):
    """Health of one spiking layer over a batch; scalar tensors without gradient, all in [0, 1]."""

    firing_rate: Tensor  # mean over steps, samples and neurons
    window_share: Tensor  # share of (neuron, step) with |v - v_th| < w
    always_on: Tensor  # share of neurons that fire at every step for every sample
    never_on: Tensor  # share of neurons that fire at no step for any sample


class ActorHealth(NamedTuple):
    """Health of an actor: the rate of its input spikes (None without spikes) and of each layer, output last."""

    input_firing_rate: Tensor | None
    layers: tuple[LayerHealth, ...]


NOTHING_SPIKES = ActorHealth(None, ())


@torch.no_grad()
def layer_health(spikes: Tensor, membrane_potential: Tensor, threshold: float, window: float) -> LayerHealth:
    """Measure one layer.

    Args:
        spikes: ``[T, B, n]``, 0 or 1.
        membrane_potential: ``[T, B, n]``, before the reset.
        threshold: ``v_th``.
        window: ``w`` of the surrogate gradient.
    """
    counts = spikes.sum(dim=(0, 1))
    return LayerHealth(
        firing_rate=spikes.mean(),
        window_share=((membrane_potential - threshold).abs() < window).float().mean(),
        always_on=(counts == spikes.shape[0] * spikes.shape[1]).float().mean(),
        never_on=(counts == 0).float().mean(),
    )
