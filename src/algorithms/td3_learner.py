"""TD3's update: critics every step, actor and targets every ``policy_delay`` steps (METHOD section 3)."""

from __future__ import annotations

import copy

import torch
from torch import Tensor

from src.actors.actor import Actor
from src.algorithms import td3
from src.algorithms.critic import TwinCritic
from src.algorithms.learner import Learner, Minibatches, UpdateStreams
from src.algorithms.metrics import BurstRecord
from src.algorithms.parameters import FlatParameters
from src.algorithms.policy import DeterministicPolicy
from src.config import TD3Config


class TD3Learner(Learner):
    """TD3 for any actor.

    Args:
        config: hyper-parameters.
        actor: network ``[B, N] -> raw [B, M]``.
        critic: the twin critics.
        action_limit: bound of the actions.
        streams: exploration noise, target noise and encoder draws.
    """

    def __init__(
        self, config: TD3Config, actor: Actor, critic: TwinCritic, action_limit: float, streams: UpdateStreams
    ) -> None:
        super().__init__()
        self.config, self.streams, self.action_limit = config, streams, action_limit
        self.policy, self.critic = DeterministicPolicy(actor, action_limit), critic
        self.target_policy, self.target_critic = copy.deepcopy(self.policy), copy.deepcopy(critic)
        self.modules = {
            "actor": actor,
            "critic": critic,
            "target_actor": self.target_policy.actor,
            "target_critic": self.target_critic,
        }
        self.flat = {name: FlatParameters([module]) for name, module in self.modules.items()}
        self.optimizers = {
            "actor": self.flat["actor"].adam(config.actor_learning_rate),
            "critic": self.flat["critic"].adam(config.critic_learning_rate),
        }

    @torch.no_grad()
    def explore(self, observation: Tensor) -> Tensor:
        """``clip(pi(s) + limit * N(0, exploration_noise), -limit, limit)``."""
        action = self.policy(observation, self.streams.encoder)
        noise = torch.randn(action.shape, generator=self.streams.exploration).to(action.device)
        scale = self.config.exploration_noise * self.action_limit
        return (action + scale * noise).clamp_(-self.action_limit, self.action_limit)

    def learn(self, burst: Minibatches) -> dict[str, float]:
        """See :meth:`Learner.update`; the policy delay counts the updates of the run."""
        c, record = self.config, BurstRecord()
        noise = torch.randn(burst.action.shape, generator=self.streams.update_noise).to(burst.action.device)
        noise = noise.mul_(c.target_noise * self.action_limit)
        inputs = torch.cat([burst.observation, burst.action], dim=-1)
        has_moved = False
        for group in td3.target_groups(self.critic_updates, len(inputs), c.policy_delay):
            part = slice(group.start, group.stop)
            targets = self._bellman_targets(
                burst.next_observation[part], noise[part], burst.reward[part], burst.terminated[part]
            )
            for index, target in zip(group, targets):
                moves = td3.moves_actor(self.critic_updates, c.policy_delay)
                self.critic_step(inputs[index], target, record)
                if moves:
                    self._update_actor(burst.observation[index], record, with_health=not has_moved)
                    has_moved = True
        if has_moved:
            (first_values,) = record.samples()
            record.add("actor_loss", td3.actor_loss(first_values))
        return record.means()

    @torch.no_grad()
    def _bellman_targets(self, next_observation: Tensor, noise: Tensor, reward: Tensor, terminated: Tensor) -> Tensor:
        """Targets ``[G, B]`` of G minibatches at once, where the same target networks serve them."""
        c = self.config
        following = self.target_policy.minibatches(next_observation, self.streams.encoder)
        clip = c.target_noise_clip * self.action_limit
        next_action = td3.smoothed_target_action(following, noise, clip, self.action_limit)
        next_values = self.target_critic(next_observation.flatten(0, 1), next_action.flatten(0, 1))
        return td3.bellman_target(reward, terminated, next_values.unflatten(1, reward.shape), c.discount)

    def _update_actor(self, observation: Tensor, record: BurstRecord, with_health: bool) -> None:
        action, health, pull = self.policy.vjp(observation, self.streams.encoder, with_health)
        first_value, to_action = self.critic.action_gradient(observation, action, members=1)
        record.add_samples(first_value[0])
        pull(to_action, self.flat["actor"].gradient_of)
        self.actor_step(record, health)
        self.flat["target_actor"].follow(self.flat["actor"], self.config.polyak)
        self.flat["target_critic"].follow(self.flat["critic"], self.config.polyak)
