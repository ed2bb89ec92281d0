"""TD3's updates on the engine: those of :class:`src.algorithms.td3.TD3`, without autograd.

What is reordered: the targets of the minibatches that the same target networks serve are computed in one pass. What is
not: every equation, and the order of the random draws.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import torch
from torch import Tensor

from src.algorithms import td3
from src.algorithms.learner import Batch
from src.algorithms.metrics import BurstRecord
from src.engine.learner import FastLearner, bind


class FastTD3(FastLearner, td3.TD3):
    """TD3 for an actor that the engine supports; arguments as of :class:`src.algorithms.td3.TD3`."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self._target_actor = bind(self.target_policy.actor)

    @torch.no_grad()
    def learn(self, burst: Batch) -> dict[str, float]:
        """See :meth:`src.algorithms.td3.TD3.learn`."""
        self.check_addresses()
        c, record = self.config, BurstRecord()
        noise = torch.randn(burst.action.shape, generator=self.streams.update_noise)
        noise = noise.mul_(c.target_noise * self.action_limit)
        inputs = torch.cat([burst.observation, burst.action], dim=-1)
        has_moved = False
        for group in target_groups(self.critic_updates, len(inputs), c.policy_delay):
            part = slice(group.start, group.stop)
            targets = self._targets(
                burst.next_observation[part], noise[part], burst.reward[part], burst.terminated[part]
            )
            for index, target in zip(group, targets):
                moves = td3.is_policy_update(self.critic_updates, c.policy_delay)
                values, loss = self._critic.squared_error_step(inputs[index], target)
                self.optimizers["critic"].step()
                self.critic_updates += 1
                record.add("critic_loss", loss)
                record.add_values(values)
                if moves:
                    self._actor_step(burst.observation[index], record, with_health=not has_moved)
                    has_moved = True
        if has_moved:
            (first_values,) = record.samples()
            record.add("actor_loss", td3.actor_loss(first_values))
        return record.means()

    def _targets(self, next_observation: Tensor, noise: Tensor, reward: Tensor, terminated: Tensor) -> Tensor:
        """Targets ``[G, B]`` of G minibatches at once."""
        c = self.config
        action = torch.tanh(self._target_actor.raw(next_observation, self.streams.encoder)) * self.action_limit
        clip = c.target_noise_clip * self.action_limit
        next_action = td3.smoothed_target_action(action, noise, clip, self.action_limit)
        inputs = torch.cat([next_observation.flatten(0, 1), next_action.flatten(0, 1)], dim=-1)
        next_values = self._target_critic.forward(inputs).squeeze(-1).unflatten(1, reward.shape)
        return td3.bellman_target(reward, terminated, next_values, c.discount)

    def _actor_step(self, observation: Tensor, record: BurstRecord, with_health: bool) -> None:
        """One step up the gradient of Q1 at the actor's actions, and the targets' step."""
        (raw,), health, vjp_fn = self._actor.vjp(observation.unsqueeze(0), self.streams.encoder, with_health)
        squashed = torch.tanh(raw)
        inputs = torch.cat([observation, squashed * self.action_limit], dim=-1)
        scale, first_column = -1.0 / len(inputs), observation.shape[1]
        first_value, grad_action = self._critic.minimum_input_gradient(inputs, first_column, scale, networks=1)
        record.add_samples(first_value[0])
        vjp_fn(torch.ops.aten.tanh_backward(grad_action * self.action_limit, squashed))
        self.optimizers["actor"].step()
        self.policy.actor.project()
        self.actor_updates += 1
        if health is not None:
            self.record_health(record, health)
        self.flat["target_actor"].polyak_update(self.flat["actor"], self.config.polyak)
        self.flat["target_critic"].polyak_update(self.flat["critic"], self.config.polyak)


def target_groups(first: int, count: int, delay: int) -> Iterator[range]:
    """The minibatches 0..count-1 of a burst, grouped by the target networks that they see.

    ``first`` is the number of the burst's first update, counted over the run.
    """
    start = 0
    for index in range(count):
        if td3.is_policy_update(first + index, delay) or index == count - 1:
            yield range(start, index + 1)
            start = index + 1
