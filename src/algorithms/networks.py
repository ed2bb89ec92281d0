"""What an algorithm adds to an actor: the policy that squashes its raw output, and the twin critics."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor, nn

from src.actors.actor import Actor
from src.actors.mlp import EnsembleMLP
from src.streams import Streams


class DeterministicPolicy(nn.Module):
    """``pi(s) = tanh(actor(s)) * limit``; also what an evaluation plays for SAC.

    Args:
        actor: network ``[B, N] -> [B, M]``.
        action_limit: bound of the actions.
    """

    actor: Actor

    def __init__(self, actor: Actor, action_limit: float) -> None:
        super().__init__()
        self.actor = actor
        self.action_limit = action_limit

    def forward(self, observation: Tensor, generator: torch.Generator | None = None) -> Tensor:
        """Actions ``[B, M]`` for normalised observations ``[B, N]``; the generator feeds a poisson encoder."""
        return self.squash(self.actor(observation, generator))

    def squash(self, raw: Tensor) -> Tensor:
        """``tanh(raw) * limit``."""
        return torch.tanh(raw) * self.action_limit


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
