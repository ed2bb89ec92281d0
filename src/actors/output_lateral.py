"""Intra-layer connections of the output population [ILC-SAN, Chen et al. 2024], into the current of its neurons.

    x_tau <- x_tau + W' o_(tau-1) + b'         W': each action's P neurons among themselves, self included

They differ from BPT-SAN's lateral interaction (:mod:`src.actors.lateral`), which reaches neighbours on a line and adds
to the potential.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Literal

import torch
from torch import Tensor, nn

from src.actors.initialisation import Initialiser

Connected = Literal["all", "no_self", "self_only"]


class OutputLateral(nn.Module):
    """W' and b', both drawn from U(-1/sqrt(P), 1/sqrt(P)).

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
