"""The twin critics: two networks [observation, action] -> value, evaluated in one batched product per layer."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from torch import Tensor, nn

from src.ensemble_mlp import EnsembleMLP
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

    def forward(self, observation: Tensor, action: Tensor, *, frozen: bool = False) -> Tensor:
        """Values ``[2, B]`` of observations ``[B, N]`` (normalised) and actions ``[B, M]``, in its units.

        ``frozen`` lets gradients flow to the action only, as an actor's update wants it.
        """
        value: Tensor = self.networks(observation, action, frozen=frozen)
        return value.squeeze(-1)

    def first_frozen(self, observation: Tensor, action: Tensor) -> Tensor:
        """Q1 alone, ``[B]``, with gradients to the action only."""
        value: Tensor = self.networks(observation, action, members=1, frozen=True)
        return value.flatten()

    def regress(
        self, inputs: Tensor, target: Tensor, gradient_of: Mapping[nn.Parameter, Tensor]
    ) -> tuple[Tensor, Tensor]:
        """One regression step by hand instead of by autograd: fills the gradient of every parameter.

        Returns the values ``[2, B]`` of ``inputs``, observation and action ``[B, N + M]``, and the loss of
        :func:`src.algorithms.td3.critic_loss` to the target ``[B]``.
        """
        gradients = [gradient_of[p] for p in self.networks.parameter_pairs]
        return self.networks.regress(inputs, target, gradients)
