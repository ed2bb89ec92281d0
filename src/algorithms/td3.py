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


def target_groups(count: int, delay: int) -> Iterator[range]:
    """The updates of a burst, grouped by the target networks that they see.

    The targets move after every update whose index is a multiple of the delay: with 2, before 1, 3, 5, ...
    """
    start = 0
    for last in [*range(0, count, delay), count - 1]:
        if start <= last:
            yield range(start, last + 1)
        start = last + 1


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
