"""AAN, the artificial actor network: a plain multilayer perceptron with ReLU."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from src.actors.actor import Actor, Pull
from src.actors.health import NOTHING_SPIKES, ActorHealth
from src.config import MLPActorConfig
from src.ensemble_mlp import EnsembleMLP, ensemble_mlp, ensemble_mlp_vjp
from src.places import GradientOf, Places
from src.streams import Streams


class MLPActor(Actor):
    """``observation -> ReLU layers (the trunk) -> linear head``; SAC may share the trunk.

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
        self.places = Places()

    def forward(self, observation: Tensor, generator: torch.Generator | None = None) -> Tensor:
        """Raw action ``[B, M]``, trunk and head in one operation; draws nothing."""
        parameters = self.places.once(MLPActor._in_order, self)
        return ensemble_mlp(parameters, False, observation, self.places).squeeze(0)

    def minibatches(self, observation: Tensor, generator: torch.Generator | None = None) -> Tensor:
        """See :meth:`Actor.minibatches`; in one operation."""
        if type(self) is not MLPActor:
            return super().minibatches(observation, generator)
        with torch.no_grad():
            return self(observation.flatten(0, 1)).unflatten(0, observation.shape[:2])

    def vjp_after(
        self, before: Tensor, observation: Tensor, generator: torch.Generator | None = None, with_health: bool = False
    ) -> tuple[Tensor, Tensor, ActorHealth | None, Pull]:
        """See :meth:`Actor.vjp_after`; in one operation."""
        if type(self) is not MLPActor:
            return super().vjp_after(before, observation, generator, with_health)
        raw, health, pull = self._vjp(torch.cat([before, observation]), with_health, len(observation))
        return raw[: len(before)], raw[len(before) :], health, pull

    def vjp(
        self, observation: Tensor, generator: torch.Generator | None = None, with_health: bool = False
    ) -> tuple[Tensor, ActorHealth | None, Pull]:
        """See :meth:`Actor.vjp`; without autograd."""
        if type(self) is not MLPActor:  # which may compute something else
            return super().vjp(observation, generator, with_health)
        return self._vjp(observation, with_health, None)

    def _vjp(self, observation: Tensor, with_health: bool, last: int | None) -> tuple[Tensor, ActorHealth | None, Pull]:
        parameters = self.places.once(MLPActor._in_order, self)
        raw, pull = ensemble_mlp_vjp(parameters, False, observation, self.places, last)

        def fill(to_raw: Tensor, gradient_of: GradientOf) -> None:
            pull(to_raw.unsqueeze(0), gradient_of, False)

        return raw.squeeze(0), NOTHING_SPIKES if with_health else None, fill

    def _in_order(self) -> tuple[nn.Parameter, ...]:
        return *self.hidden.parameter_pairs, *self.output.parameter_pairs
