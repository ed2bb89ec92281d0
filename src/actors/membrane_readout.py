"""Membrane readout: each action is the potential of a neuron that integrates and never fires [ILC-SAN].

m_tau = lambda m_(tau-1) + sum over p of w_p o_(tau,p) + b,       raw = m_T, or the mean or largest |m| of the steps
"""

from __future__ import annotations

import math
from typing import Literal

import torch
from torch import Tensor, nn

from src.actors.initialisation import Initialiser

Reading = Literal["last_membrane", "mean_membrane", "max_membrane"]


class MembraneReadout(nn.Module):
    """``spikes [T, B, M*P] -> raw action [B, M]``; parameters as of the population decoder.

    Args:
        reading: the last potential, the mean over the steps, or the one of largest magnitude (the first of equals).
        decay: lambda.
        action_size: M.
        population_size: P, output neurons of one action dimension.
        initialiser: of this module; PyTorch's default distribution with fan-in P.
    """

    def __init__(
        self, reading: Reading, decay: float, action_size: int, population_size: int, initialiser: Initialiser
    ) -> None:
        super().__init__()
        self.reading = reading
        self.decay = decay
        bound = 1.0 / math.sqrt(population_size)
        self.weight = initialiser.uniform("weight", (action_size, population_size), bound)
        self.bias = initialiser.uniform("bias", (action_size,), bound)

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
