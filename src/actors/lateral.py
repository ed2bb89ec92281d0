"""Intra-layer connections: lateral interaction between neighbouring neurons [P, ``Intra``].

    Intra_j = sum over neighbours k of w'_jk * o_k,(tau-1)

Neighbours lie at index distance 1..radius on a line; beyond its ends there are zeros.
"""

from __future__ import annotations

import math

from torch import Tensor, nn

from src.actors.initialisation import Initialiser
from src.config import LateralConfig


def neighbour_offsets(radius: int, include_self: bool) -> tuple[int, ...]:
    """Index distances ``k - j`` of the neighbours in the order of the sum, e.g. ``(-2, -1, 1, 2)``."""
    return tuple(offset for offset in range(-radius, radius + 1) if offset != 0 or include_self)


class LateralInteraction(nn.Module):
    """The lateral weights of a layer: one row for each neighbour offset.

    Weights are drawn from U(-b, b) with ``b = init_scale / sqrt(2 radius)``.

    Args:
        config: radius (at least 1), whether a neuron is its own neighbour, weights per neuron or shared.
        neurons: width n of the layer.
        initialiser: of this module.
    """

    def __init__(self, config: LateralConfig, neurons: int, initialiser: Initialiser) -> None:
        super().__init__()
        self.offsets = neighbour_offsets(config.radius, config.include_self)
        self.neurons = neurons
        shape = (len(self.offsets), neurons) if config.weights == "per_neuron" else (len(self.offsets),)
        self.weight = initialiser.uniform("weight", shape, config.init_scale / math.sqrt(2 * config.radius))

    def forward(self) -> Tensor:
        """Weights ``[K, n]``: ``w'_jk`` at row (offset k - j), column j."""
        if self.weight.dim() == 2:
            return self.weight
        return self.weight.unsqueeze(1).expand(-1, self.neurons)
