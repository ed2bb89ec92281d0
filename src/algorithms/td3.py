"""TD3 (Fujimoto, van Hoof and Meger, 2018) in the form of Spinning Up [SU].

The functions below are held against TorchRL's ``TD3Loss`` (``tests/algorithms/test_td3.py``); :meth:`TD3.learn` puts
them together.
"""

from __future__ import annotations

import copy
from collections.abc import Iterator

import torch
from torch import Tensor

from src.actors.actor import Actor
from src.algorithms.learner import Batch, Learner, UpdateStreams, adam, polyak_update
from src.algorithms.metrics import BurstRecord
from src.algorithms.networks import DeterministicPolicy, TwinCritic
from src.config.schema import TD3Config


def smoothed_target_action(action: Tensor, noise: Tensor, noise_clip: float, action_limit: float) -> Tensor:
    """Target policy smoothing: ``clip(a' + clip(noise, -c, c), -limit, limit)``; all ``[..., B, M]``."""
    return (action + noise.clamp(-noise_clip, noise_clip)).clamp(-action_limit, action_limit)


def bellman_target(reward: Tensor, terminated: Tensor, next_values: Tensor, discount: float) -> Tensor:
    """``y = r + gamma (1 - terminated) min(Q1', Q2')``, ``[..., B]``.

    ``terminated`` is 1 where the episode ended by itself; a time limit is bootstrapped through.
    ``next_values`` is ``[2, ..., B]``, the others ``[..., B]``.
    """
    return torch.addcmul(reward, 1.0 - terminated, torch.minimum(*next_values.unbind()), value=discount)


def critic_loss(values: Tensor, target: Tensor) -> Tensor:
    """Mean squared error to the common target, summed over the two critics; values ``[2, B]``, target ``[B]``."""
    return torch.nn.functional.mse_loss(values, target.expand_as(values), reduction="sum") / values.shape[1]


def actor_loss(first_value: Tensor) -> Tensor:
    """``-mean over B of Q1(s, pi(s))``; ``first_value`` is ``[..., B]``."""
    return -first_value.mean(-1)


def is_policy_update(update: int, delay: int) -> bool:
    """Whether the actor and the targets move at an update, counted over the run from 0: every ``delay``-th does."""
    return update % delay == 0


class TD3(Learner):
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
        self.config = config
        self.streams = streams
        self.action_limit = action_limit
        self.policy = DeterministicPolicy(actor, action_limit)
        self.critic = critic
        self.target_policy = copy.deepcopy(self.policy)
        self.target_critic = copy.deepcopy(critic)
        self.modules = {
            "actor": actor,
            "critic": critic,
            "target_actor": self.target_policy.actor,
            "target_critic": self.target_critic,
        }
        self.optimizers = {
            "actor": adam(config.actor_learning_rate, actor),
            "critic": adam(config.critic_learning_rate, critic),
        }

    @torch.no_grad()
    def explore(self, observation: Tensor) -> Tensor:
        """``clip(pi(s) + limit * N(0, exploration_noise), -limit, limit)``."""
        action = self.act(observation, self.streams.encoder)
        noise = torch.randn(action.shape, generator=self.streams.exploration).to(action)
        scale = self.config.exploration_noise * self.action_limit
        return (action + scale * noise).clamp(-self.action_limit, self.action_limit)

    def learn(self, burst: Batch) -> dict[str, float]:
        """See :meth:`Learner.learn`; the noise of the burst is drawn at its start, in units of the action limit."""
        config = self.config
        record = BurstRecord()
        actor_updates_before = self.actor_updates
        noise_clip = config.target_noise_clip * self.action_limit
        updates = len(burst.reward) // self.minibatches_per_update
        shape = (updates, *burst.action.shape[1:])
        noise = torch.randn(shape, generator=self.streams.update_noise).to(burst.action)
        noise = noise * (config.target_noise * self.action_limit)
        for batch, smoothing in zip(self.critic_minibatches(burst, record), noise):
            with torch.no_grad():
                next_action = self.target_policy(batch.next_observation, self.streams.encoder)
                next_action = smoothed_target_action(next_action, smoothing, noise_clip, self.action_limit)
                next_values = self.target_critic(batch.next_observation, next_action)
                target = bellman_target(batch.reward, batch.terminated, next_values, config.discount)

            values = self.critic(batch.observation, batch.action)
            loss = critic_loss(values, target)
            self.minimise(loss, "critic")
            record.add("critic_loss", loss)
            record.add_values(values)

            if is_policy_update(self.critic_updates, config.policy_delay):
                with_health = self.actor_updates == actor_updates_before  # the first of the burst
                raw, health = self.actor_pass(batch.observation, with_health)
                first_value, _ = self.critic(batch.observation, self.policy.squash(raw))
                loss = actor_loss(first_value)
                self.minimise(loss, "actor")
                self.policy.actor.project()
                self.actor_updates += 1
                record.add("actor_loss", loss)
                if health is not None:
                    self.record_health(record, health)

                self.follow_targets()
            self.critic_updates += 1
        return record.means()

    def critic_minibatches(self, burst: Batch, record: BurstRecord) -> Iterator[Batch]:
        """The minibatch of each update of the critics, as it comes; a proxy target learns between two of them."""
        return burst.minibatches()

    def follow_targets(self) -> None:
        """The targets' step: ``target <- polyak * target + (1 - polyak) * online``."""
        polyak_update(self.target_policy, self.policy, self.config.polyak)
        polyak_update(self.target_critic, self.critic, self.config.polyak)
