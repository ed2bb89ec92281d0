"""SAC's updates on the engine: those of :class:`src.algorithms.sac.SAC`, without autograd.

What is reordered: between two updates of the actor it is asked twice, at s' for the target and at s for its own update;
here in one pass over both minibatches.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import torch
from torch import Tensor

from src.actors.health import NOTHING_SPIKES, ActorHealth
from src.actors.mlp import MLPActor
from src.algorithms import sac
from src.algorithms.learner import Batch
from src.algorithms.metrics import BurstRecord
from src.engine import tanh_gaussian
from src.engine.learner import FastLearner
from src.engine.mlp import BoundMLP, last_rows

#: Takes the gradients w.r.t. mean and log-std, ``[B, M]``; fills those w.r.t. the parameters.
HeadsVJP = Callable[[Tensor, Tensor], None]


class FastSAC(FastLearner, sac.SAC):
    """SAC for an actor that the engine supports; arguments as of :class:`src.algorithms.sac.SAC`."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self._shared_trunk = self.config.log_std_network == "shared"
        self._log_std = BoundMLP(self.log_std.network)
        if self._shared_trunk:
            actor = self.policy.actor
            assert isinstance(actor, MLPActor)  # only it has a trunk (the rules of src.config)
            self._trunk = BoundMLP(actor.hidden)
            self._mean = BoundMLP(actor.output)

    @torch.no_grad()
    def explore(self, observation: Tensor) -> Tensor:
        """A sample of the policy, ``[B, M]`` for ``[B, N]``."""
        if self._shared_trunk:
            features = self._trunk.forward(observation).squeeze(0)
            mean, log_std = (head.forward(features).squeeze(0) for head in (self._mean, self._log_std))
        else:
            mean = self._actor.raw_action(observation, self.streams.encoder)
            log_std = self._log_std.forward(observation).squeeze(0)
        noise = torch.randn(mean.shape, generator=self.streams.exploration)
        return tanh_gaussian.sample(mean, log_std, noise, self.bounds).action

    @torch.no_grad()
    def learn(self, burst: Batch) -> dict[str, float]:
        """See :meth:`src.algorithms.sac.SAC.learn`."""
        self.check_addresses()
        c, record = self.config, BurstRecord()
        noise = torch.randn((2, *burst.action.shape), generator=self.streams.update_noise)
        inputs = torch.cat([burst.observation, burst.action], dim=-1)
        batch = burst.reward.shape[1]
        grad_log_probability = burst.reward.new_full((batch,), 1.0 / batch).mul_(c.alpha)
        for index, (observation, _, reward, next_observation, terminated) in enumerate(zip(*burst)):
            both = torch.stack([next_observation, observation])
            means, log_stds, health, vjp_fn = (self._heads if self._shared_trunk else self._networks)(both, index == 0)
            next_drawn = tanh_gaussian.sample(means[0], log_stds[0], noise[0, index], self.bounds)
            drawn = tanh_gaussian.sample(means[1], log_stds[1], noise[1, index], self.bounds)
            next_inputs = torch.cat([next_observation, next_drawn.action], dim=-1)
            next_values = self._target_critic.forward(next_inputs).squeeze(-1)
            target = sac.bellman_target(
                reward, terminated, next_values, next_drawn.log_probability, c.discount, c.alpha
            )
            values, loss = self._critic.squared_error_step(inputs[index], target)
            self.optimizers["critic"].step()
            self.critic_updates += 1
            record.add("critic_loss", loss)
            record.add_values(values)
            drawn_inputs = torch.cat([observation, drawn.action], dim=-1)
            values, grad_action = self._critic.minimum_input_gradient(
                drawn_inputs, observation.shape[1], -1.0 / batch, networks=2
            )
            record.add_samples(drawn.log_probability, values)
            vjp_fn(*tanh_gaussian.gradient(drawn, grad_action, grad_log_probability, self.bounds))
            for name in self.policy_optimizers:
                self.optimizers[name].step()
            self.policy.actor.project()
            self.actor_updates += 1
            if health is not None:
                self.record_health(record, health)
            self.flat["target_critic"].polyak_update(self.flat["critic"], c.polyak)
        log_probability, values = record.samples()
        record.add("actor_loss", sac.actor_loss(log_probability, values, c.alpha))
        record.add("log_probability", log_probability.mean(-1))
        return record.means()

    def _networks(self, observation: Tensor, with_health: bool) -> tuple[Tensor, Tensor, ActorHealth | None, HeadsVJP]:
        """Means and log-stds ``[2, B, M]`` by a network each; the VJP is that of the second minibatch."""
        means, health, vjp_mean = self._actor.vjp(observation, self.streams.encoder, with_health)
        saved = self._log_std.forward_saving(observation.flatten(0, 1))
        last = last_rows(saved, observation.shape[1])

        def vjp_fn(grad_mean: Tensor, grad_log_std: Tensor) -> None:
            vjp_mean(grad_mean)
            self._log_std.backward(last, grad_log_std.unsqueeze(0))

        return means, saved[-1][0].unflatten(0, observation.shape[:2]), health, vjp_fn

    def _heads(self, observation: Tensor, with_health: bool) -> tuple[Tensor, Tensor, ActorHealth | None, HeadsVJP]:
        """The same by a head each of the actor's trunk."""
        batch = observation.shape[1]
        trunk = self._trunk.forward_saving(observation.flatten(0, 1))
        mean, log_std = (head.forward_saving(trunk[-1][0]) for head in (self._mean, self._log_std))

        def vjp_fn(grad_mean: Tensor, grad_log_std: Tensor) -> None:
            through_mean = self._mean.backward(last_rows(mean, batch), grad_mean.unsqueeze(0), with_input=True)
            through_log_std = self._log_std.backward(
                last_rows(log_std, batch), grad_log_std.unsqueeze(0), with_input=True
            )
            assert through_mean is not None and through_log_std is not None
            self._trunk.backward(last_rows(trunk, batch), torch.add(through_mean, through_log_std).unsqueeze(0))

        health = NOTHING_SPIKES if with_health else None
        means, log_stds = (saved[-1][0].unflatten(0, observation.shape[:2]) for saved in (mean, log_std))
        return means, log_stds, health, vjp_fn
