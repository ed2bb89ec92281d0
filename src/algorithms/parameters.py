"""All parameters of a module in one flat tensor: one Adam call and one Polyak call instead of one per parameter."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor, nn

from src.algorithms.adam import FlatAdam


class FlatParameters:
    """Re-points the parameters of ``modules`` to views of one flat tensor, the modules keep working as before."""

    def __init__(self, modules: Sequence[nn.Module]) -> None:
        self.parameters = [p for module in modules for p in module.parameters() if p.requires_grad]
        self.values = torch.cat([p.detach().reshape(-1) for p in self.parameters])
        self.gradient = torch.zeros_like(self.values)
        self.gradient_of: dict[nn.Parameter, Tensor] = {}  # a view of the flat gradient for each parameter
        offset = 0
        for p in self.parameters:
            part = slice(offset, offset + p.numel())
            p.data = self.values[part].view(p.shape)
            self.gradient_of[p] = self.gradient[part].view(p.shape)
            offset += p.numel()

    def adam(self, learning_rate: float) -> FlatAdam:
        """Adam over the flat tensor."""
        return FlatAdam(self.values, self.gradient, learning_rate)

    def follow(self, online: FlatParameters, polyak: float) -> None:
        """Polyak averaging of a target network: ``target <- polyak * target + (1 - polyak) * online`` [SU]."""
        self.values.lerp_(online.values, 1.0 - polyak)
