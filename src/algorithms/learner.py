"""What TD3 and SAC have in common: the interface of the training loop and the state that a checkpoint holds."""

from __future__ import annotations

import copy
from abc import ABC, abstractmethod
from collections.abc import Iterator
from typing import Any, ClassVar, Literal, NamedTuple

import torch
from torch import Tensor, nn

from src.actors.health import ActorHealth
from src.algorithms.metrics import BurstRecord, Diverged
from src.algorithms.networks import DeterministicPolicy, TwinCritic


class Batch(NamedTuple):
    """Transitions to learn from: one minibatch of B, or, contiguous, the C of a burst.

    C is ``minibatches_per_update`` times the burst's updates.
    """

    observation: Tensor  # [B, N], or [C, B, N]
    action: Tensor  # [B, M], or [C, B, M]
    reward: Tensor  # [B], or [C, B]
    next_observation: Tensor  # as observation
    terminated: Tensor  # as reward; 1.0 where the episode ended by itself

    def minibatches(self) -> Iterator[Batch]:
        """The minibatches of a burst in their order."""
        return map(Batch._make, zip(*self))


class UpdateStreams(NamedTuple):
    """Random streams that updates and exploration draw from; their states belong to the checkpoint."""

    exploration: torch.Generator
    update_noise: torch.Generator  # TD3: target policy smoothing; SAC: samples of the policy
    encoder: torch.Generator


class Learner(ABC):
    """An algorithm: acts, explores, learns from bursts of minibatches.

    Subclasses fill ``modules`` and ``optimizers`` (both saved by name) and the attributes below.
    """

    backend: ClassVar[Literal["plain", "fast"]] = "plain"
    policy: DeterministicPolicy
    critic: TwinCritic
    streams: UpdateStreams

    def __init__(self) -> None:
        self.modules: dict[str, nn.Module] = {}
        self.optimizers: dict[str, torch.optim.Adam] = {}
        self.critic_updates = 0
        self.actor_updates = 0
        self.minibatches_per_update = 1

    @abstractmethod
    def explore(self, observation: Tensor) -> Tensor:
        """Exploring actions ``[B, M]`` for normalised observations ``[B, N]``."""

    @abstractmethod
    def learn(self, burst: Batch) -> dict[str, float]:
        """One critic update per ``minibatches_per_update`` minibatches; returns the means of the burst.

        Raises:
            Diverged: when a loss is not finite.
        """

    @torch.no_grad()
    def act(self, observation: Tensor, generator: torch.Generator) -> Tensor:
        """The deterministic policy that evaluations play: ``[B, M]`` for ``[B, N]``."""
        return self.policy.squash(self.raw_action(observation, generator))

    def raw_action(self, observation: Tensor, generator: torch.Generator) -> Tensor:
        """The actor's output ``[B, M]`` for acting, without gradient."""
        raw: Tensor = self.policy.actor(observation, generator)
        return raw

    def minimise(self, loss: Tensor, *names: str) -> None:
        """One step of the named optimizers by the gradient of the loss to their parameters, and to no others."""
        parameters = [p for name in names for p in parameters_of(self.optimizers[name])]
        for p in parameters:
            p.grad = None
        loss.backward(inputs=parameters)  # type: ignore[no-untyped-call]
        for name in names:
            self.optimizers[name].step()

    def actor_pass(self, observation: Tensor, with_health: bool) -> tuple[Tensor, ActorHealth | None]:
        """The actor's raw output ``[B, M]`` and, where asked for, its spiking health in the same pass."""
        actor = self.policy.actor
        if with_health:
            return actor.forward_with_health(observation, self.streams.encoder)
        return actor(observation, self.streams.encoder), None

    def record_health(self, record: BurstRecord, health: ActorHealth) -> None:
        """Note spiking health, and the norms of the gradients of the actor's last step."""
        record.add("actor_gradient_norm", self.actor_gradient().norm())
        layers = self.policy.actor.layer_parameters()
        record.add_health(health, [[p.grad for p in layer if p.grad is not None] for layer in layers])

    def actor_gradient(self) -> Tensor:
        """All gradients of the actor's last step in one row."""
        return torch.cat([p.grad.flatten() for p in parameters_of(self.optimizers["actor"]) if p.grad is not None])

    def check_finite(self) -> None:
        """Raise :class:`Diverged` when a parameter is not finite."""
        for name, module in self.modules.items():
            if not all(bool(torch.isfinite(p).all()) for p in module.parameters()):
                raise Diverged(f"a parameter of the {name} is not finite")

    def state_dict(self) -> dict[str, Any]:
        """Networks, targets, optimizers and counters: copies, tensors and plain containers only."""
        return {
            "modules": {n: {k: v.clone() for k, v in m.state_dict().items()} for n, m in self.modules.items()},
            "optimizers": {n: copy.deepcopy(o.state_dict()) for n, o in self.optimizers.items()},
            "critic_updates": self.critic_updates,
            "actor_updates": self.actor_updates,
        }

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Restore what :meth:`state_dict` gave; nothing of it is kept."""
        for name, module in self.modules.items():
            module.load_state_dict(state["modules"][name])
        for name, optimizer in self.optimizers.items():
            optimizer.load_state_dict(copy.deepcopy(state["optimizers"][name]))  # PyTorch would keep its tensors
        self.critic_updates = state["critic_updates"]
        self.actor_updates = state["actor_updates"]


def adam(learning_rate: float, *modules: nn.Module) -> torch.optim.Adam:
    """Adam over all that learns in the modules; betas (0.9, 0.999) and eps 1e-8 are PyTorch's defaults, and [SU]'s."""
    parameters = [p for module in modules for p in module.parameters() if p.requires_grad]
    return torch.optim.Adam(parameters, lr=learning_rate)


def parameters_of(optimizer: torch.optim.Optimizer) -> list[nn.Parameter]:
    """All parameters that an optimizer steps."""
    return [p for group in optimizer.param_groups for p in group["params"]]


@torch.no_grad()
def polyak_update(target: nn.Module, online: nn.Module, polyak: float) -> None:
    """Polyak averaging of a target network: ``target <- polyak * target + (1 - polyak) * online`` [SU]."""
    for slow, fast in zip(target.parameters(), online.parameters(), strict=True):
        slow.lerp_(fast, 1.0 - polyak)
