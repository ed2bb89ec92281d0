"""The twin critics: two networks [observation, action] -> value, evaluated side by side."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor, nn

from src.actors.mlp import EnsembleMLP
from src.streams import Streams


class TwinCritic(nn.Module):
    """Q1 and Q2, MLPs ``[o, a] -> hidden -> 1`` with ReLU [SU].

    Args:
        observation_size: N.
        action_size: M.
        hidden_sizes: widths of the hidden layers.
        streams: the run's random streams.
    """

    def __init__(self, observation_size: int, action_size: int, hidden_sizes: Sequence[int], streams: Streams) -> None:
        super().__init__()
        self.networks = EnsembleMLP([observation_size + action_size, *hidden_sizes, 1], 2, streams, "critic")

    def forward(self, observation: Tensor, action: Tensor) -> Tensor:
        """Values ``[2, B]`` of observations ``[B, N]`` (normalised) and actions ``[B, M]``, in its units."""
        value: Tensor = self.networks(torch.cat([observation, action], dim=-1))
        return value.squeeze(-1)
