"""TD3 (Fujimoto et al. 2018) as pure functions of values and batches, in the form of Spinning Up.

Independent oracle: TorchRL's ``TD3Loss`` (``tests/algorithms/test_td3.py``).
"""

from __future__ import annotations

from collections.abc import Iterator

import torch
from torch import Tensor


def smoothed_target_action(action: Tensor, noise: Tensor, noise_clip: float, action_limit: float) -> Tensor:
    """Target policy smoothing: ``clip(a' + clip(noise, -c, c), -limit, limit)``; all ``[B, M]``."""
    return (action + noise.clamp(-noise_clip, noise_clip)).clamp_(-action_limit, action_limit)


def moves_actor(update: int, delay: int) -> bool:
    """Whether the actor and the targets move at an update, counted over the run from 0: every ``delay``-th does."""
    return update % delay == 0


def target_groups(first: int, count: int, delay: int) -> Iterator[range]:
    """The minibatches 0..count-1 of a burst, grouped by the target networks that they see.

    ``first`` is the number of the burst's first update, counted over the run.
    """
    start = 0
    for index in range(count):
        if moves_actor(first + index, delay) or index == count - 1:
            yield range(start, index + 1)
            start = index + 1


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
