"""SAC's update: critics, then the actor, then the targets, every step (METHOD section 3)."""

from __future__ import annotations

import copy

import torch
from torch import Tensor

from src.actors.actor import Actor
from src.algorithms import sac
from src.algorithms.critic import TwinCritic
from src.algorithms.gaussian_policy import GaussianPolicy
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
        streams: exploration noise, the policy's noise in updates, and encoder draws.
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
        self.config, self.streams = config, streams
        self.policy, self.critic, self.log_std = DeterministicPolicy(actor, action_limit), critic, log_std
        self.target_critic = copy.deepcopy(critic)
        shared_trunk = config.log_std_network == "shared"
        bounds = sac.Bounds(config.log_std_min, config.log_std_max, action_limit)
        self.gaussian = GaussianPolicy(actor, log_std, shared_trunk, bounds)
        self.modules = {"actor": actor, "log_std": log_std, "critic": critic, "target_critic": self.target_critic}
        actor_group = [actor, log_std] if shared_trunk else [actor]
        self.flat = {
            "actor": FlatParameters(actor_group),
            "critic": FlatParameters([critic]),
            "target_critic": FlatParameters([self.target_critic]),
        }
        self.optimizers = {
            "actor": self.flat["actor"].adam(config.actor_learning_rate),
            "critic": self.flat["critic"].adam(config.critic_learning_rate),
        }
        if not shared_trunk:
            self.flat["log_std"] = FlatParameters([log_std])
            self.optimizers["log_std"] = self.flat["log_std"].adam(config.log_std_learning_rate)
        learning = [self.flat[name] for name in self.optimizers if name != "critic"]
        self.gradient_of = {p: gradient for flat in learning for p, gradient in flat.gradient_of.items()}

    @torch.no_grad()
    def explore(self, observation: Tensor) -> Tensor:
        """A sample of the policy."""
        shape = (len(observation), self.log_std.action_size)
        noise = torch.randn(shape, generator=self.streams.exploration).to(observation.device)
        return self.gaussian.sample(observation, noise, self.streams.encoder).action

    def learn(self, burst: Minibatches) -> dict[str, float]:
        """See :meth:`Learner.update`.

        Between two updates of the actor it is asked twice, at s' for the target and at s for its own update: in one
        pass. Noise is drawn at the start of the burst, by minibatch and use.
        """
        c, record = self.config, BurstRecord()
        noise = torch.randn((2, *burst.action.shape), generator=self.streams.update_noise).to(burst.action.device)
        inputs = torch.cat([burst.observation, burst.action], dim=-1)
        batches = zip(*(x.unbind() for x in burst), zip(*noise.unbind(0)))
        to_log_probability = burst.reward.new_full((burst.reward.shape[1],), 1.0 / burst.reward.shape[1]).mul_(c.alpha)
        for index, (observation, _, reward, next_observation, terminated, both_noises) in enumerate(batches):
            following, own, health, pull = self.gaussian.vjp_after(
                next_observation, observation, both_noises, self.streams.encoder, with_health=index == 0
            )
            next_values = self.target_critic_values(next_observation, following.action)
            target = sac.bellman_target(reward, terminated, next_values, following.log_probability, c.discount, c.alpha)
            self.critic_step(inputs[index], target, record)
            values, to_action = self.critic.action_gradient(observation, own.action, members=2)
            record.add_samples(own.log_probability, values)
            pull(to_action, to_log_probability, self.gradient_of)
            self.actor_step(record, health, *(() if self.gaussian.shared_trunk else ("log_std",)))
            self.flat["target_critic"].follow(self.flat["critic"], c.polyak)
        log_probability, values = record.samples()
        record.add("actor_loss", sac.actor_loss(log_probability, values, c.alpha))
        record.add("log_probability", log_probability.mean(-1))
        return record.means()

    @torch.no_grad()
    def target_critic_values(self, observation: Tensor, action: Tensor) -> Tensor:
        """``[2, B]``."""
        values: Tensor = self.target_critic(observation, action)
        return values
