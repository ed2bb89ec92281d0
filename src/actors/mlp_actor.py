"""AAN, the artificial actor network: a plain multilayer perceptron with ReLU."""

from __future__ import annotations

import math
from itertools import pairwise

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from src.actors.actor import Actor
from src.actors.initialisation import Initialiser
from src.config import MLPActorConfig
from src.streams import Streams


class DenseLayer(nn.Module):
    """A linear layer in PyTorch's default initialisation, drawn from the layer's own streams."""

    def __init__(self, inputs: int, outputs: int, initialiser: Initialiser) -> None:
        super().__init__()
        bound = 1.0 / math.sqrt(inputs)
        self.weight = initialiser.uniform("weight", (outputs, inputs), bound)
        self.bias = initialiser.uniform("bias", (outputs,), bound)

    def forward(self, features: Tensor) -> Tensor:
        """``[B, inputs] -> [B, outputs]``."""
        return F.linear(features, self.weight, self.bias)


class MLPActor(Actor):
    """``observation -> ReLU layers (the trunk) -> linear head``; SAC may share the trunk.

    Args:
        config: hidden sizes.
        observation_size: N.
        action_size: M.
        streams: the run's random streams.
    """

    def __init__(self, config: MLPActorConfig, observation_size: int, action_size: int, streams: Streams) -> None:
        super().__init__()
        initialiser = Initialiser(streams)
        sizes = (observation_size, *config.hidden_sizes)
        self.hidden = nn.ModuleList(
            DenseLayer(inputs, outputs, initialiser.at("hidden").at(index))
            for index, (inputs, outputs) in enumerate(pairwise(sizes))
        )
        self.output = DenseLayer(sizes[-1], action_size, initialiser.at("output"))

    def trunk(self, observation: Tensor) -> Tensor:
        """Features of the last hidden layer, ``[B, N] -> [B, hidden]``."""
        features = observation
        for layer in self.hidden:
            features = torch.relu(layer(features))
        return features

    def head(self, features: Tensor) -> Tensor:
        """Raw action of the trunk's features, ``[B, hidden] -> [B, M]``."""
        return self.output(features)

    def forward(self, observation: Tensor, generator: torch.Generator | None = None) -> Tensor:
        """Raw action ``[B, M]``; draws nothing."""
        return self.head(self.trunk(observation))
