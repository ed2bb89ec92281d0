"""AAN, the artificial actor network: a plain multilayer perceptron with ReLU."""

from __future__ import annotations

import torch
from torch import Tensor

from src.actors.actor import Actor
from src.actors.mlp import EnsembleMLP
from src.config import MLPActorConfig
from src.streams import Streams


class MLPActor(Actor):
    """``observation -> ReLU layers (the trunk) -> linear head``; SAC's log-std may be a second head on the trunk [SU].

    Args:
        config: hidden sizes.
        observation_size: N.
        action_size: M.
        streams: the run's random streams; PyTorch's default Linear initialisation.
    """

    def __init__(self, config: MLPActorConfig, observation_size: int, action_size: int, streams: Streams) -> None:
        super().__init__()
        sizes = (observation_size, *config.hidden_sizes)
        self.hidden = EnsembleMLP(sizes, 1, streams, "actor.hidden", final_relu=True)
        self.output = EnsembleMLP((sizes[-1], action_size), 1, streams, "actor.output")

    def features(self, observation: Tensor) -> Tensor:
        """Output of the trunk, ``[B, H]``, for observations ``[B, N]``."""
        features: Tensor = self.hidden(observation)
        return features.squeeze(0)

    def head(self, features: Tensor) -> Tensor:
        """Raw action ``[B, M]`` for features ``[B, H]``."""
        raw: Tensor = self.output(features)
        return raw.squeeze(0)

    def forward(self, observation: Tensor, generator: torch.Generator | None = None) -> Tensor:
        """Raw action ``[B, M]``; draws nothing."""
        return self.head(self.features(observation))
