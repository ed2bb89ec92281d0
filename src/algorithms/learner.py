"""What TD3 and SAC have in common: the interface of the training loop and the state that a checkpoint holds."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any, NamedTuple

import torch
from torch import Tensor, nn

from src.actors.health import ActorHealth
from src.algorithms.adam import FlatAdam
from src.algorithms.critic import TwinCritic
from src.algorithms.metrics import BurstRecord, Diverged
from src.algorithms.parameters import FlatParameters
from src.algorithms.policy import DeterministicPolicy
from src.places import fixed_places


class Minibatches(NamedTuple):
    """The minibatches of one burst: count x batch x size, float32, contiguous."""

    observation: Tensor  # [C, B, N]
    action: Tensor  # [C, B, M]
    reward: Tensor  # [C, B]
    next_observation: Tensor  # [C, B, N]
    terminated: Tensor  # [C, B], 1.0 where the episode ended by itself


class UpdateStreams(NamedTuple):
    """Random streams that updates and exploration draw from; their states belong to the checkpoint."""

    exploration: torch.Generator
    update_noise: torch.Generator  # TD3: target policy smoothing; SAC: samples of the policy
    encoder: torch.Generator


class Learner(ABC):
    """An algorithm: acts, explores, learns from bursts of minibatches.

    Subclasses fill ``modules`` (saved by name), ``flat`` (their flat parameters) and ``optimizers``.
    """

    policy: DeterministicPolicy
    critic: TwinCritic
    streams: UpdateStreams
    critic_updates: int = 0
    actor_updates: int = 0

    def __init__(self) -> None:
        self.modules: dict[str, nn.Module] = {}
        self.flat: dict[str, FlatParameters] = {}
        self.optimizers: dict[str, FlatAdam] = {}

    @abstractmethod
    def explore(self, observation: Tensor) -> Tensor:
        """Exploring actions ``[B, M]`` for normalised observations ``[B, N]``."""

    def update(self, burst: Minibatches) -> dict[str, float]:
        """One gradient update per minibatch; returns the means of the burst.

        Raises:
            Diverged: when a loss is not finite.
        """
        with fixed_places(*self.modules.values()):
            return self.learn(burst)

    @abstractmethod
    def learn(self, burst: Minibatches) -> dict[str, float]:
        """:meth:`update`, while every parameter keeps its place."""

    @torch.no_grad()
    def act(self, observation: Tensor, generator: torch.Generator) -> Tensor:
        """The deterministic policy that evaluations play: ``[B, M]`` for ``[B, N]``."""
        action: Tensor = self.policy(observation, generator)
        return action

    def check_finite(self) -> None:
        """Raise :class:`Diverged` when a parameter is not finite."""
        for name, flat in self.flat.items():
            if not bool(torch.isfinite(flat.values).all()):
                raise Diverged(f"a parameter of the {name} is not finite")

    def critic_step(self, inputs: Tensor, target: Tensor, record: BurstRecord) -> None:
        """One optimizer step of the critics towards a target ``[B]`` at observations and actions ``[B, N + M]``."""
        values, loss = self.critic.regress(inputs, target, self.flat["critic"].gradient_of)
        self.optimizers["critic"].step()
        self.critic_updates += 1
        record.add("critic_loss", loss)
        record.add_values(values)

    def actor_step(self, record: BurstRecord, health: ActorHealth | None, *others: str) -> None:
        """One optimizer step of the actor (and of what learns with it) by the gradients as they stand, and the
        projection of its sigma.

        Args:
            record: of the burst.
            health: of the same pass, or None.
            others: names of the flat parameters that learn with the actor's.
        """
        for name in ("actor", *others):
            self.optimizers[name].step()
        actor, flat = self.policy.actor, self.flat["actor"]
        actor.project()
        self.actor_updates += 1
        if health is not None:
            record.add("actor_gradient_norm", flat.gradient.norm())
            record.add_health(health, actor, flat.gradient_of)

    def state_dict(self) -> dict[str, Any]:
        """Networks, targets, optimizers and counters: tensors and plain containers only."""
        return {
            "modules": {n: {k: v.clone() for k, v in m.state_dict().items()} for n, m in self.modules.items()},
            "optimizers": {n: o.state_dict() for n, o in self.optimizers.items()},
            "critic_updates": self.critic_updates,
            "actor_updates": self.actor_updates,
        }

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Restore what :meth:`state_dict` gave, in place."""
        for name, module in self.modules.items():
            module.load_state_dict(state["modules"][name])
        for name, optimizer in self.optimizers.items():
            optimizer.load_state_dict(state["optimizers"][name])
        self.critic_updates = state["critic_updates"]
        self.actor_updates = state["actor_updates"]
