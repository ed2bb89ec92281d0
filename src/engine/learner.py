"""What the fast TD3 and SAC have in common: flat parameters, and networks bound to them."""

from __future__ import annotations

from typing import Any, cast

import torch
from torch import Tensor

from src.actors.actor import Actor
from src.actors.mlp import MLPActor
from src.actors.spiking_actor import SpikingActor
from src.algorithms.learner import Learner, parameters_of
from src.algorithms.networks import TwinCritic
from src.engine.bound import BoundActor
from src.engine.flat import FlatAdam, FlatParameters
from src.engine.mlp import BoundMLP, BoundMLPActor
from src.engine.spiking import BoundSpikingActor


def bind(actor: Actor) -> BoundActor:
    """The passes on the kernels of an actor that the engine supports, by its parameters as they lie now."""
    if isinstance(actor, MLPActor):
        return BoundMLPActor(actor)
    assert isinstance(actor, SpikingActor)
    return BoundSpikingActor(actor)


class FastLearner(Learner):
    """Goes before the plain learner among the bases of a class; arguments are the plain learner's."""

    backend = "fast"
    target_critic: TwinCritic

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        parts = {name: parameters_of(optimizer) for name, optimizer in self.optimizers.items()}
        parts |= {name: list(m.parameters()) for name, m in self.modules.items() if name.startswith("target")}
        self.flat = {name: FlatParameters(parameters) for name, parameters in parts.items()}
        for name, plain in self.optimizers.items():
            self.optimizers[name] = cast(Any, FlatAdam(self.flat[name], plain.param_groups[0]["lr"]))
        self._actor = bind(self.policy.actor)
        self._critic = BoundMLP(self.critic.networks)
        self._target_critic = BoundMLP(self.target_critic.networks)

    @torch.no_grad()
    def raw_action(self, observation: Tensor, generator: torch.Generator) -> Tensor:
        """The actor's output ``[B, M]`` for acting."""
        return self._actor.raw_action(observation, generator)

    def actor_gradient(self) -> Tensor:
        """See :meth:`Learner.actor_gradient`."""
        return self.flat["actor"].gradient

    def check_addresses(self) -> None:
        """See :meth:`FlatParameters.check`; once a burst."""
        for flat in self.flat.values():
            flat.check()
