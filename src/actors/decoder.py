"""Population decoder: each action is a linear map of the firing rates of its own output neurons.

r = mean over tau of o_tau,      raw_m = sum over p of w_mp r_mp + b_m
"""

from __future__ import annotations

import math

from torch import Tensor, nn

from src.actors.initialisation import Initialiser


class PopulationDecoder(nn.Module):
    """A grouped linear map, ``spikes [T, B, M*P] -> raw action [B, M]``.

    Args:
        action_size: M.
        population_size: P, output neurons of one action dimension.
        initialiser: of this module; PyTorch's default distribution with fan-in P.
    """

    def __init__(self, action_size: int, population_size: int, initialiser: Initialiser) -> None:
        super().__init__()
        bound = 1.0 / math.sqrt(population_size)
        self.weight = initialiser.uniform("weight", (action_size, population_size), bound)
        self.bias = initialiser.uniform("bias", (action_size,), bound)

    def forward(self, spikes: Tensor) -> Tensor:
        """Raw action ``[B, M]``."""
        rates = spikes.mean(0).unflatten(1, self.weight.shape)  # [B, M, P]
        return (rates * self.weight).sum(-1) + self.bias
