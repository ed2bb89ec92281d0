"""Multilayer perceptrons with ReLU: E independent networks of one shape, evaluated side by side.

    h_0 = x,   h_k = relu(h_(k-1) W_k + b_k) for k < L,   y = h_(L-1) W_L + b_L

Two serve as the twin critics; of one are made the AAN, SAC's log standard deviation and a proxy of an actor.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import torch
from torch import Tensor, nn

from src.actors.actor import Actor
from src.config.schema import MLPActorConfig
from src.streams import Streams


class EnsembleMLP(nn.Module):
    """E networks with the layer sizes ``sizes``.

    Weights are stored as ``[E, in, out]``, biases as ``[E, 1, out]``, both drawn from PyTorch's default distribution
    for Linear, U(-1/sqrt(in), 1/sqrt(in)), each member and parameter from its own stream.

    Args:
        sizes: layer sizes, input first.
        ensemble: number E of networks.
        streams: the run's random streams.
        name: prefix of the initialisation streams.
        final_relu: the last layer has a ReLU too (a trunk whose features several heads share).
    """

    def __init__(
        self, sizes: Sequence[int], ensemble: int, streams: Streams, name: str, *, final_relu: bool = False
    ) -> None:
        super().__init__()
        self.weights = nn.ParameterList()
        self.biases = nn.ParameterList()
        self.final_relu = final_relu
        for k, (fan_in, fan_out) in enumerate(pairwise(sizes)):
            weight = torch.empty(ensemble, fan_in, fan_out)
            bias = torch.empty(ensemble, 1, fan_out)
            bound = fan_in**-0.5
            for e in range(ensemble):
                weight[e].uniform_(-bound, bound, generator=streams.torch("initialisation", f"{name}.{e}.{k}.weight"))
                bias[e].uniform_(-bound, bound, generator=streams.torch("initialisation", f"{name}.{e}.{k}.bias"))
            self.weights.append(nn.Parameter(weight))
            self.biases.append(nn.Parameter(bias))

    def forward(self, x: Tensor) -> Tensor:
        """Outputs ``[E, B, out]`` of all networks for inputs ``[B, in]``."""
        last = len(self.weights) - 1
        h = x.expand(len(self.weights[0]), *x.shape)
        for k, (weight, bias) in enumerate(zip(self.weights, self.biases)):
            h = torch.baddbmm(bias, h, weight)
            if k < last or self.final_relu:
                h = torch.relu(h)
        return h


class MLP(Actor):
    """One such network alone; arguments as of :class:`EnsembleMLP`."""

    def __init__(self, sizes: Sequence[int], streams: Streams, name: str) -> None:
        super().__init__()
        self.network = EnsembleMLP(sizes, 1, streams, name)

    def forward(self, observation: Tensor, generator: torch.Generator | None = None) -> Tensor:
        """Outputs ``[B, out]`` for inputs ``[B, in]``; draws nothing."""
        output: Tensor = self.network(observation)
        return output.squeeze(0)


class MLPActor(Actor):
    """AAN, the artificial actor network: ``observation -> ReLU layers (the trunk) -> linear head``.

    SAC's log-std may be a second head on the trunk [SU].

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
