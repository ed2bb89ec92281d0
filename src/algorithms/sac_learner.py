"""SAC's update: critics, then the actor, then the targets, every step (METHOD section 3)."""

from __future__ import annotations

import copy

import torch
from torch import Tensor

from src.actors.actor import Actor
from src.actors.health import ActorHealth
from src.actors.mlp_actor import MLPActor
from src.algorithms import sac
from src.algorithms.critic import TwinCritic
from src.algorithms.learner import Learner, Minibatches, UpdateStreams
from src.algorithms.metrics import BurstRecord
from src.algorithms.parameters import FlatParameters
from src.algorithms.policy import DeterministicPolicy, LogStdNetwork
from src.config import SACConfig


class SACLearner(Learner):
    """SAC for any actor: the actor gives the mean, a network of its own or the actor's trunk the log-std.

    Args:
        config: hyper-parameters.
        actor: network ``[B, N] -> mean [B, M]``.
        log_std: network of the log standard deviation.
        critic: the twin critics.
        action_limit: bound of the actions.
        streams: exploration noise, target noise and encoder draws.
    """

    def __init__(
        self,
        config: SACConfig,
        actor: Actor,
        log_std: LogStdNetwork,
        critic: TwinCritic,
        action_limit: float,
        streams: UpdateStreams,
    ) -> None:
        super().__init__()
        self.config, self.streams, self.action_limit = config, streams, action_limit
        self.policy, self.critic, self.log_std = DeterministicPolicy(actor, action_limit), critic, log_std
        self.target_critic = copy.deepcopy(critic)
        self.shared_trunk = config.log_std_network == "shared"
        self.modules = {"actor": actor, "log_std": log_std, "critic": critic, "target_critic": self.target_critic}
        actor_group = [actor, log_std] if self.shared_trunk else [actor]
        self.flat = {
            "actor": FlatParameters(actor_group),
            "critic": FlatParameters([critic]),
            "target_critic": FlatParameters([self.target_critic]),
        }
        self.optimizers = {
            "actor": self.flat["actor"].adam(config.actor_learning_rate),
            "critic": self.flat["critic"].adam(config.critic_learning_rate),
        }
        if not self.shared_trunk:
            self.flat["log_std"] = FlatParameters([log_std])
            self.optimizers["log_std"] = self.flat["log_std"].adam(config.log_std_learning_rate)

    def _mean_and_log_std(self, observation: Tensor) -> tuple[Tensor, Tensor]:
        actor = self.policy.actor
        if self.shared_trunk:
            assert isinstance(actor, MLPActor)  # only it has a trunk (src/config_rules.py)
            features = actor.trunk(observation)
            return actor.head(features), self.log_std(features)
        return actor(observation, self.streams.encoder), self.log_std(observation)

    @torch.no_grad()
    def explore(self, observation: Tensor) -> Tensor:
        """A sample of the policy."""
        mean, log_std = self._mean_and_log_std(observation)
        noise = torch.randn(mean.shape, generator=self.streams.exploration).to(mean.device)
        return sac.tanh_gaussian(mean, log_std, noise, self.action_limit)[0]

    def update(self, burst: Minibatches) -> dict[str, float]:
        """See :meth:`Learner.update`."""
        c, record = self.config, BurstRecord()
        noise = torch.randn((2, *burst.action.shape), generator=self.streams.target_noise).to(burst.action.device)
        inputs = torch.cat([burst.observation, burst.action], dim=-1)
        batches = zip(*(x.unbind() for x in burst), noise[0].unbind(), noise[1].unbind())
        for index, (observation, _, reward, next_observation, terminated, target_noise, own) in enumerate(batches):
            with torch.no_grad():
                next_action, next_log_probability = sac.tanh_gaussian(
                    *self._mean_and_log_std(next_observation), target_noise, self.action_limit
                )
                next_values = self.target_critic(next_observation, next_action)
                target = sac.bellman_target(reward, terminated, next_values, next_log_probability, c.discount, c.alpha)
            self.critic_step(inputs[index], target, record)
            self._update_actor(observation, own, record, with_health=index == 0)
            self.flat["target_critic"].follow(self.flat["critic"], c.polyak)
        return record.means()

    def _update_actor(self, observation: Tensor, noise: Tensor, record: BurstRecord, with_health: bool) -> None:
        health = None
        if with_health and self.shared_trunk:
            health = ActorHealth(input_firing_rate=None, layers=())  # nothing spikes
        if with_health and not self.shared_trunk:
            mean, health = self.policy.actor.forward_with_health(observation, self.streams.encoder)
            log_std = self.log_std(observation)
        else:
            mean, log_std = self._mean_and_log_std(observation)
        action, log_probability = sac.tanh_gaussian(mean, log_std, noise, self.action_limit)
        values, to_action = self.critic.action_gradient(observation, action, members=2)
        to_log_probability = torch.full_like(log_probability, 1.0 / len(log_probability)).mul_(self.config.alpha)
        with torch.no_grad():
            record.add("actor_loss", sac.actor_loss(log_probability, values, self.config.alpha))
            record.add("log_probability", log_probability.mean())
        groups = ("actor",) if self.shared_trunk else ("actor", "log_std")
        self.actor_step([action, log_probability], [to_action, to_log_probability], record, health, groups)
