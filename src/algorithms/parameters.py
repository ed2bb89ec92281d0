"""All parameters of a module in one flat tensor: one Adam call and one Polyak call instead of one per parameter."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import accumulate

import torch
from torch import Tensor, nn

from src.algorithms.adam import FlatAdam

#: Numbers of 4 bytes in a cache line of 64, at which every parameter begins: a product's bits may hang on that.
ALIGNMENT = 16


class FlatParameters:
    """Re-points the parameters of ``modules`` to views of one flat tensor, the modules keep working as before.

    Between them lie zeros, whose gradient is zero.
    """

    def __init__(self, modules: Sequence[nn.Module]) -> None:
        self.parameters = [p for module in modules for p in module.parameters() if p.requires_grad]
        starts = [0, *accumulate(-(-p.numel() // ALIGNMENT) * ALIGNMENT for p in self.parameters)]
        self.values = self.parameters[0].new_zeros(starts[-1])
        self.gradient = torch.zeros_like(self.values)
        self.gradient_of: dict[nn.Parameter, Tensor] = {}  # a view of the flat gradient for each parameter
        for p, start in zip(self.parameters, starts):
            part = slice(start, start + p.numel())
            self.values[part] = p.detach().reshape(-1)
            p.data = self.values[part].view(p.shape)
            self.gradient_of[p] = self.gradient[part].view(p.shape)

    def adam(self, learning_rate: float) -> FlatAdam:
        """Adam over the flat tensor."""
        return FlatAdam(self.values, self.gradient, learning_rate)

    def follow(self, online: FlatParameters, polyak: float) -> None:
        """Polyak averaging of a target network: ``target <- polyak * target + (1 - polyak) * online`` [SU]."""
        self.values.lerp_(online.values, 1.0 - polyak)
