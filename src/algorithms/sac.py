"""SAC (Haarnoja et al., 2018) with a fixed temperature, in the form of Spinning Up [SU].

The functions below are held against TorchRL's ``SACLoss`` (``tests/algorithms/test_sac.py``); :meth:`SAC.learn` puts
them together. The critic's loss is TD3's.
"""

from __future__ import annotations

import copy
import math
from typing import NamedTuple

import torch
import torch.nn.functional as F
from torch import Tensor

from src.actors.actor import Actor
from src.actors.health import NOTHING_SPIKES, ActorHealth
from src.actors.mlp import MLP, MLPActor
from src.algorithms.learner import Batch, Learner, UpdateStreams, adam, polyak_update
from src.algorithms.metrics import BurstRecord
from src.algorithms.networks import DeterministicPolicy, TwinCritic
from src.algorithms.td3 import critic_loss
from src.config.schema import SACConfig

_HALF_LOG_2PI = 0.5 * math.log(2 * math.pi)
_LOG_2 = math.log(2.0)


class Bounds(NamedTuple):
    """What the policy stays within."""

    log_std_min: float
    log_std_max: float
    action_limit: float


class Gaussian(NamedTuple):
    """The policy before it is squashed, ``[B, M]`` each."""

    mean: Tensor
    log_std: Tensor  # before it is clamped


def tanh_gaussian(mean: Tensor, log_std: Tensor, noise: Tensor, bounds: Bounds) -> tuple[Tensor, Tensor]:
    """A reparametrised sample of the squashed Gaussian and its log-probability.

    ``u = mean + exp(log_std) * noise``, ``a = limit * tanh(u)``, with the log-std clamped to its bounds,
    ``log pi = sum_M [log N(u; mean, std) - log(1 - tanh(u)^2)]`` with the numerically stable form
    ``log(1 - tanh(u)^2) = 2 (log 2 - u - softplus(-2u))`` [SU, core.py]. As in Spinning Up the density is that of
    tanh(u): a limit other than 1 would add a constant.

    Args:
        mean: ``[B, M]``.
        log_std: ``[B, M]``, before it is clamped.
        noise: ``[B, M]``, standard normal.
        bounds: of log-std and actions.

    Returns:
        actions ``[B, M]`` and log-probabilities ``[B]``.
    """
    log_std = log_std.clamp(bounds.log_std_min, bounds.log_std_max)
    u = torch.addcmul(mean, log_std.exp(), noise)
    log_normal = -0.5 * noise * noise - log_std - _HALF_LOG_2PI
    log_probability = (log_normal - 2.0 * (_LOG_2 - u - F.softplus(-2.0 * u))).sum(dim=-1)
    return torch.tanh(u) * bounds.action_limit, log_probability


def bellman_target(
    reward: Tensor, terminated: Tensor, next_values: Tensor, next_log_probability: Tensor, discount: float, alpha: float
) -> Tensor:
    """``y = r + gamma (1 - terminated) (min(Q1', Q2') - alpha log pi(a'|s'))``; values ``[2, B]``, else ``[B]``."""
    soft_value = torch.minimum(*next_values.unbind()) - alpha * next_log_probability
    return torch.addcmul(reward, 1.0 - terminated, soft_value, value=discount)


def actor_loss(log_probability: Tensor, values: Tensor, alpha: float) -> Tensor:
    """``mean over B of alpha log pi - min(Q1, Q2)``; ``log_probability`` ``[..., B]``, ``values`` ``[2, ..., B]``."""
    return (alpha * log_probability - torch.minimum(*values.unbind())).mean(-1)


class SAC(Learner):
    """SAC for any actor: the actor gives the mean, a network of its own or a second head on its trunk the log-std.

    Args:
        config: hyper-parameters.
        actor: network ``[B, N] -> mean [B, M]``; with ``log_std_network="shared"`` an :class:`MLPActor`.
        log_std: network of the log standard deviation before it is clamped: on the observation, so that only the mean
            spikes [PopSAN], or with ``log_std_network="shared"`` a linear layer on the actor's trunk [SU].
        critic: the twin critics.
        action_limit: bound of the actions.
        streams: exploration noise, the policy's noise in updates, and encoder draws.
    """

    def __init__(
        self,
        config: SACConfig,
        actor: Actor,
        log_std: MLP,
        critic: TwinCritic,
        action_limit: float,
        streams: UpdateStreams,
    ) -> None:
        super().__init__()
        self.config = config
        self.streams = streams
        self.action_limit = action_limit
        self.bounds = Bounds(config.log_std_min, config.log_std_max, action_limit)
        self.policy = DeterministicPolicy(actor, action_limit)
        self.log_std = log_std
        self.critic = critic
        self.target_critic = copy.deepcopy(critic)
        self.modules = {"actor": actor, "log_std": log_std, "critic": critic, "target_critic": self.target_critic}
        if config.log_std_network == "shared":
            self.optimizers = {"actor": adam(config.actor_learning_rate, actor, log_std)}
        else:
            self.optimizers = {
                "actor": adam(config.actor_learning_rate, actor),
                "log_std": adam(config.log_std_learning_rate, log_std),
            }
        self.policy_optimizers = tuple(self.optimizers)
        self.optimizers["critic"] = adam(config.critic_learning_rate, critic)

    def gaussian(self, observation: Tensor, with_health: bool = False) -> tuple[Gaussian, ActorHealth | None]:
        """The policy at observations ``[B, N]`` and, where asked for, the actor's spiking health in the same pass."""
        if self.config.log_std_network == "separate":
            mean, health = self.actor_pass(observation, with_health)
            return Gaussian(mean, self.log_std(observation)), health
        actor = self.policy.actor
        assert isinstance(actor, MLPActor)  # only it has a trunk to share; other configurations are refused
        features = actor.features(observation)
        return Gaussian(actor.head(features), self.log_std(features)), NOTHING_SPIKES if with_health else None

    @torch.no_grad()
    def explore(self, observation: Tensor) -> Tensor:
        """A sample of the policy."""
        policy, _ = self.gaussian(observation)
        noise = torch.randn(policy.mean.shape, generator=self.streams.exploration).to(observation)
        return tanh_gaussian(*policy, noise, self.bounds)[0]

    def learn(self, burst: Batch) -> dict[str, float]:
        """See :meth:`Learner.learn`; the noise of the burst is drawn at its start, by use and minibatch."""
        config = self.config
        record = BurstRecord()
        noise = torch.randn((2, *burst.action.shape), generator=self.streams.update_noise).to(burst.action)
        for index, (batch, target_noise, actor_noise) in enumerate(zip(burst.minibatches(), *noise)):
            with torch.no_grad():
                policy, _ = self.gaussian(batch.next_observation)
                next_action, next_log_probability = tanh_gaussian(*policy, target_noise, self.bounds)
                next_values = self.target_critic(batch.next_observation, next_action)
                target = bellman_target(
                    batch.reward, batch.terminated, next_values, next_log_probability, config.discount, config.alpha
                )

            values = self.critic(batch.observation, batch.action)
            loss = critic_loss(values, target)
            self.minimise(loss, "critic")
            self.critic_updates += 1
            record.add("critic_loss", loss)
            record.add_values(values)

            policy, health = self.gaussian(batch.observation, with_health=index == 0)
            action, log_probability = tanh_gaussian(*policy, actor_noise, self.bounds)
            loss = actor_loss(log_probability, self.critic(batch.observation, action), config.alpha)
            self.minimise(loss, *self.policy_optimizers)
            self.policy.actor.project()
            self.actor_updates += 1
            record.add("actor_loss", loss)
            record.add("log_probability", log_probability.mean())
            if health is not None:
                self.record_health(record, health)

            polyak_update(self.target_critic, self.critic, config.polyak)
        return record.means()
