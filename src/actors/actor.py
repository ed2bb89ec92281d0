"""What every actor offers to the algorithms and the training loop."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from src.actors.health import NOTHING_SPIKES, ActorHealth
from src.actors.population_encoder import PopulationEncoder


class Actor(nn.Module):
    """A policy network ``observation [B, N] -> raw action [B, M]``, before squashing.

    An actor of your own needs :meth:`forward` only; it learns by autograd through it. A checkpoint holds its parameters
    and nothing else: random numbers come from ``generator`` alone (no dropout), nothing else may learn (no batch
    statistics), and there is no evaluation mode.
    """

    def forward(self, observation: Tensor, generator: torch.Generator | None = None) -> Tensor:
        """Raw action, ``[B, M]``.

        Args:
            observation: normalised observations, ``[B, N]``.
            generator: the stream of an actor that draws (Poisson coding).
        """
        raise NotImplementedError

    def forward_with_health(
        self, observation: Tensor, generator: torch.Generator | None = None
    ) -> tuple[Tensor, ActorHealth]:
        """:meth:`forward` with the spiking health of the same pass; gradients flow through the raw action."""
        return self(observation, generator), NOTHING_SPIKES

    def layer_parameters(self) -> list[list[nn.Parameter]]:
        """The parameters of each spiking layer, for gradient norms."""
        return []

    def project(self) -> None:
        """Bring the parameters back into their range; called after each optimizer step. Here: the encoder's sigma."""
        for module in self.modules():
            if isinstance(module, PopulationEncoder):
                module.project()

    def connection_count(self) -> int:
        """Learnable numbers; of a dendritic layer each unmasked synapse once."""
        return sum(parameter.numel() for parameter in self.parameters() if parameter.requires_grad)
