"""SAC (Haarnoja et al. 2018) with a fixed temperature, as pure functions, in the form of Spinning Up.

Independent oracle: TorchRL's ``SACLoss`` (``tests/algorithms/test_sac.py``). The critic's loss is TD3's.
"""

from __future__ import annotations

import math

import torch
import torch.nn.functional as F
from torch import Tensor

_HALF_LOG_2PI = 0.5 * math.log(2 * math.pi)
_LOG_2 = math.log(2.0)


def tanh_gaussian(mean: Tensor, log_std: Tensor, noise: Tensor, action_limit: float) -> tuple[Tensor, Tensor]:
    """A reparametrised sample of the squashed Gaussian and its log-probability.

    ``u = mean + exp(log_std) * noise``, ``a = limit * tanh(u)``,
    ``log pi = sum_M [log N(u; mean, std) - log(1 - tanh(u)^2)]`` with the numerically stable form
    ``log(1 - tanh(u)^2) = 2 (log 2 - u - softplus(-2u))`` [SU, core.py]. As in Spinning Up the density is that of
    tanh(u): a limit other than 1 would add a constant.

    Args:
        mean: ``[B, M]``.
        log_std: ``[B, M]``.
        noise: ``[B, M]``, standard normal.
        action_limit: bound of the actions.

    Returns:
        actions ``[B, M]`` and log-probabilities ``[B]``.
    """
    u = torch.addcmul(mean, log_std.exp(), noise)
    log_normal = -0.5 * noise * noise - log_std - _HALF_LOG_2PI
    log_probability = (log_normal - 2.0 * (_LOG_2 - u - F.softplus(-2.0 * u))).sum(dim=-1)
    return torch.tanh(u) * action_limit, log_probability


def bellman_target(
    reward: Tensor, terminated: Tensor, next_values: Tensor, next_log_probability: Tensor, discount: float, alpha: float
) -> Tensor:
    """``y = r + gamma (1 - terminated) (min(Q1', Q2') - alpha log pi(a'|s'))``; values ``[2, B]``, else ``[B]``."""
    soft_value = torch.minimum(next_values[0], next_values[1]) - alpha * next_log_probability
    return torch.addcmul(reward, 1.0 - terminated, soft_value, value=discount)


def actor_loss(log_probability: Tensor, values: Tensor, alpha: float) -> Tensor:
    """``mean(alpha log pi - min(Q1, Q2))``; ``log_probability`` ``[B]``, ``values`` ``[2, B]``."""
    return (alpha * log_probability - torch.minimum(values[0], values[1])).mean()
