"""From the spikes of the output population to actions: firing rates, or neurons that integrate and never fire.

Each action has its own P neurons::

    population decoder:   r = mean over tau of o_tau,   raw_m = sum over p of w_mp r_mp + b_m
    membrane readout:     m_tau = lambda m_(tau-1) + sum over p of w_p o_(tau,p) + b        [ILC-SAN]
                          raw = m_T, or the mean or largest |m| of the steps
"""

from __future__ import annotations

import math
from typing import Literal

import torch
from torch import Tensor, nn

from src.actors.initialisation import Initialiser

Reading = Literal["last_membrane", "mean_membrane", "max_membrane"]


class PopulationDecoder(nn.Module):
    """A grouped linear map of firing rates, ``spikes [T, B, M*P] -> raw action [B, M]``.

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


class MembraneReadout(PopulationDecoder):
    """Each action is a membrane potential; shapes and parameters as of the population decoder.

    Args:
        reading: the last potential, the mean over the steps, or the one of largest magnitude (the first of equals).
        decay: lambda.
        action_size: M.
        population_size: P.
        initialiser: of this module.
    """

    def __init__(
        self, reading: Reading, decay: float, action_size: int, population_size: int, initialiser: Initialiser
    ) -> None:
        super().__init__(action_size, population_size, initialiser)
        self.reading = reading
        self.decay = decay

    def forward(self, spikes: Tensor) -> Tensor:
        """Raw action ``[B, M]``."""
        inputs = (spikes.unflatten(2, self.weight.shape) * self.weight).sum(-1) + self.bias  # [T, B, M]
        membrane = torch.zeros_like(inputs[0])
        potentials = []
        for each in inputs:
            membrane = self.decay * membrane + each
            potentials.append(membrane)
        steps = torch.stack(potentials)
        if self.reading == "last_membrane":
            return membrane
        if self.reading == "mean_membrane":
            return steps.mean(0)
        return steps.gather(0, steps.abs().argmax(0, keepdim=True)).squeeze(0)
