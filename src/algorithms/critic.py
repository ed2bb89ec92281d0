"""The twin critics: two networks [observation, action] -> value, evaluated in one batched product per layer."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor, nn

from src.ensemble_mlp import EnsembleMLP
from src.places import GradientOf
from src.streams import Streams


class TwinCritic(nn.Module):
    """Q1 and Q2, MLPs ``[o, a] -> hidden -> 1`` with ReLU (METHOD section 3).

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

    def action_gradient(self, observation: Tensor, action: Tensor, members: int) -> tuple[Tensor, Tensor]:
        """Values of the first ``members`` networks, ``[members, B]``, and the gradient to the action, ``[B, M]``.

        The gradient is that of ``-mean over B of min over the members of Q(o, a)``: what an actor's loss asks of the
        critics, without autograd.
        """
        return self.networks.smallest_output_gradient(observation, action, -1.0 / len(action), members)

    def regress(self, inputs: Tensor, target: Tensor, gradient_of: GradientOf) -> tuple[Tensor, Tensor]:
        """One regression step by hand instead of by autograd: fills the gradients that ``gradient_of`` holds.

        Returns the values ``[2, B]`` of ``inputs``, observation and action ``[B, N + M]``, and the loss of
        :func:`src.algorithms.td3.critic_loss` to the target ``[B]``.
        """
        return self.networks.regress(inputs, target, gradient_of)
