"""Policy heads: what an algorithm adds to an actor's raw output.

TD3 squashes it: ``a = tanh(raw) * limit``. SAC takes it as the mean of a tanh-Gaussian.
"""

from __future__ import annotations

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


class LogStdNetwork(nn.Module):
    """SAC's log standard deviation, before it is clamped to [log_std_min, log_std_max] (:func:`sac.tanh_gaussian`).

    ``separate``: a ReLU network on the normalised observation, so that only the mean spikes [PopSAN];
    ``shared``: a linear layer on the trunk of the multilayer perceptron [SU].

    Args:
        input_size: N, or the width of the trunk.
        action_size: M.
        streams: the run's random streams.
        hidden_sizes: widths of the hidden layers; none on a trunk.
    """

    def __init__(self, input_size: int, action_size: int, streams: Streams, hidden_sizes: tuple[int, ...]) -> None:
        super().__init__()
        self.action_size = action_size
        self.network = EnsembleMLP([input_size, *hidden_sizes, action_size], 1, streams, "log_std")

    def forward(self, features: Tensor) -> Tensor:
        """``[B, M]`` for ``[B, input_size]``."""
        log_std: Tensor = self.network(features)
        return log_std.squeeze(0)
