"""TD3 with a proxy target [Xu et al., NeurIPS 2025]: a ReLU network that imitates the actor acts in the target.

Before each critic update, K times: a minibatch, and one step of Adam on

    mean over batch and actions of (pi'(s) - pi(s))^2,       pi' the proxy, pi the actor, detached

The critic then learns from the last of these minibatches, its target from ``pi'(s')``; there is no target actor. All
else is :class:`src.algorithms.td3.TD3`.
"""

from __future__ import annotations

from collections.abc import Iterator

import torch
from torch import Tensor

from src.actors.actor import Actor
from src.algorithms.learner import Batch, UpdateStreams, adam, polyak_update
from src.algorithms.metrics import BurstRecord
from src.algorithms.networks import DeterministicPolicy, TwinCritic
from src.algorithms.td3 import TD3
from src.config.schema import TD3ProxyConfig


def proxy_loss(proxy_action: Tensor, action: Tensor) -> Tensor:
    """``mean over B and M of (pi'(s) - pi(s))^2``; both ``[B, M]``."""
    return torch.nn.functional.mse_loss(proxy_action, action)


class TD3Proxy(TD3):
    """TD3 whose critic's target is made by a proxy of the actor.

    Args:
        config: TD3's, and the proxy's K and learning rate.
        actor: network ``[B, N] -> raw [B, M]``.
        critic: the twin critics.
        proxy: network ``[B, N] -> raw [B, M]``, not yet trained.
        action_limit: bound of the actions.
        streams: exploration noise, target noise and encoder draws.
    """

    def __init__(
        self,
        config: TD3ProxyConfig,
        actor: Actor,
        critic: TwinCritic,
        proxy: Actor,
        action_limit: float,
        streams: UpdateStreams,
    ) -> None:
        super().__init__(config, actor, critic, action_limit, streams)
        self.minibatches_per_update = config.proxy_steps
        self.target_policy = DeterministicPolicy(proxy, action_limit)
        del self.modules["target_actor"]
        self.modules["proxy"] = proxy
        self.optimizers["proxy"] = adam(config.proxy_learning_rate, proxy)

    def critic_minibatches(self, burst: Batch, record: BurstRecord) -> Iterator[Batch]:
        """The last of each K minibatches, after the proxy has learnt from all of them."""
        for number, batch in enumerate(burst.minibatches(), start=1):
            with torch.no_grad():
                action = self.policy(batch.observation, self.streams.encoder)
            loss = proxy_loss(self.target_policy(batch.observation), action)
            self.minimise(loss, "proxy")
            record.add("proxy_loss", loss)
            if number % self.minibatches_per_update == 0:
                yield batch

    def follow_targets(self) -> None:
        """The target critics' step; the proxy follows the actor by imitation."""
        polyak_update(self.target_critic, self.critic, self.config.polyak)
