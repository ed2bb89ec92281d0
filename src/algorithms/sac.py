"""SAC (Haarnoja et al. 2018) with a fixed temperature, as pure functions, in the form of Spinning Up.

Independent oracle: TorchRL's ``SACLoss`` (``tests/algorithms/test_sac.py``). The critic's loss is TD3's.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import torch
import torch.nn.functional as F
from torch import Tensor
from torch.autograd.function import once_differentiable

from src.actors.kernels import takes_kernel
from src.algorithms.tanh_gaussian_kernel import gradient_kernel, sample_kernel

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
    parts = (mean, log_std, noise)
    if all(takes_kernel(x) and x.shape == mean.shape for x in parts) and not noise.requires_grad:
        result: tuple[Tensor, Tensor] = _TanhGaussian.apply(mean, log_std, noise, action_limit)  # type: ignore[no-untyped-call]
        return result
    return tanh_gaussian_reference(mean, log_std, noise, action_limit)


def tanh_gaussian_reference(mean: Tensor, log_std: Tensor, noise: Tensor, action_limit: float) -> tuple[Tensor, Tensor]:
    """:func:`tanh_gaussian` in PyTorch's operators: the specification, and what other devices and precisions take."""
    u = torch.addcmul(mean, log_std.exp(), noise)
    log_normal = -0.5 * noise * noise - log_std - _HALF_LOG_2PI
    log_probability = (log_normal - 2.0 * (_LOG_2 - u - F.softplus(-2.0 * u))).sum(dim=-1)
    return torch.tanh(u) * action_limit, log_probability


class _TanhGaussian(torch.autograd.Function):
    """One kernel forward and one backward in place of some thirty small operators."""

    @staticmethod
    def forward(ctx: Any, mean: Tensor, log_std: Tensor, noise: Tensor, limit: float) -> tuple[Tensor, Tensor]:
        action, squashed, spread = (mean.new_empty(mean.shape) for _ in range(3))
        log_probability = mean.new_empty(mean.shape[0])
        inputs = (x.detach().contiguous().numpy() for x in (mean, log_std, noise))
        outputs = (x.numpy() for x in (action, log_probability, squashed, spread))
        sample_kernel()(*inputs, np.float32(limit), *outputs)
        ctx.save_for_backward(squashed, spread)
        ctx.limit = np.float32(limit)
        return action, log_probability

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, *gradients: Tensor) -> tuple[Tensor, Tensor, None, None]:
        squashed, spread = ctx.saved_tensors
        grad_mean, grad_log_std = torch.empty_like(squashed), torch.empty_like(squashed)
        grad_action, grad_log_probability = (g.contiguous().numpy() for g in gradients)
        saved, outputs = (squashed.numpy(), spread.numpy()), (grad_mean.numpy(), grad_log_std.numpy())
        gradient_kernel()(grad_action, grad_log_probability, *saved, ctx.limit, *outputs)
        return grad_mean, grad_log_std, None, None


def bellman_target(
    reward: Tensor, terminated: Tensor, next_values: Tensor, next_log_probability: Tensor, discount: float, alpha: float
) -> Tensor:
    """``y = r + gamma (1 - terminated) (min(Q1', Q2') - alpha log pi(a'|s'))``; values ``[2, B]``, else ``[B]``."""
    soft_value = torch.minimum(*next_values.unbind()) - alpha * next_log_probability
    return torch.addcmul(reward, 1.0 - terminated, soft_value, value=discount)


def actor_loss(log_probability: Tensor, values: Tensor, alpha: float) -> Tensor:
    """``mean(alpha log pi - min(Q1, Q2))``; ``log_probability`` ``[B]``, ``values`` ``[2, B]``."""
    return (alpha * log_probability - torch.minimum(*values.unbind())).mean()
