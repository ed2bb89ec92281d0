"""Intra-layer connections: lateral interaction between neighbouring neurons [P, ``Intra``], into their potential::

    Intra_j = sum over neighbours k of w'_jk * o_k,(tau-1)

Neighbours lie at index distance 1..radius on a line; beyond its ends there are zeros. And connections within the output
population [ILC-SAN, Chen et al. 2024], into the current of its neurons::

    x_tau <- x_tau + W' o_(tau-1) + b'         W': each action's P neurons among themselves, self included
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Literal

import torch
from torch import Tensor, nn

from src.actors.initialisation import Initialiser
from src.config.schema import LateralConfig

Connected = Literal["all", "no_self", "self_only"]


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


class OutputLateral(nn.Module):
    """Connections within the output population: W' and b', both drawn from U(-1/sqrt(P), 1/sqrt(P)).

    Args:
        connected: all pairs of an action's neurons, all but a neuron with itself, or only a neuron with itself. Only
            the weights that there are exist and learn.
        bias: with b'.
        lateral_gradient: gradient flows back to the spikes of the step before.
        action_size: M.
        population_size: P; at least 2 for ``no_self``.
        initialiser: of this module.
    """

    bias: nn.Parameter | None

    def __init__(
        self,
        connected: Connected,
        bias: bool,
        lateral_gradient: bool,
        action_size: int,
        population_size: int,
        initialiser: Initialiser,
    ) -> None:
        super().__init__()
        self.shape = (action_size, population_size)
        self.lateral_gradient = lateral_gradient
        itself = torch.eye(population_size, dtype=torch.bool)
        pairs = {"all": torch.ones_like(itself), "no_self": ~itself, "self_only": itself}[connected]
        self.exists: Tensor
        self.register_buffer("exists", pairs.repeat(action_size, 1, 1), persistent=False)  # [M, P, P]
        bound = 1.0 / math.sqrt(population_size)
        self.weight = initialiser.uniform("weight", (int(self.exists.sum()),), bound)
        self.bias = initialiser.uniform("bias", (action_size * population_size,), bound) if bias else None

    def matrix(self) -> Tensor:
        """W', ``[M, P, P]``, from neuron j (last) to neuron i; 0 where there is no connection."""
        zeros = torch.zeros(self.exists.shape, dtype=self.weight.dtype, device=self.weight.device)
        return zeros.masked_scatter(self.exists, self.weight)

    def feedback(self) -> Callable[[Tensor], Tensor]:
        """What spikes of the step before add to the input of the next, ``[B, M*P] -> [B, M*P]``."""
        matrix = self.matrix()

        def added(spikes: Tensor) -> Tensor:
            before = spikes if self.lateral_gradient else spikes.detach()
            term = torch.einsum("mij,bmj->bmi", matrix, before.unflatten(1, self.shape)).flatten(1)
            return term if self.bias is None else term + self.bias

        return added
