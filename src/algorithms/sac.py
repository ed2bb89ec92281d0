"""SAC (Haarnoja et al. 2018) with a fixed temperature, as pure functions, in the form of Spinning Up.

Independent oracle: TorchRL's ``SACLoss`` (``tests/algorithms/test_sac.py``). The critic's loss is TD3's.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import torch
import torch.nn.functional as F
from torch import Tensor

from src.actors.kernels import takes_kernel
from src.algorithms.tanh_gaussian_kernel import gradient_kernel, sample_kernel

_HALF_LOG_2PI = 0.5 * math.log(2 * math.pi)
_LOG_2 = math.log(2.0)


class Bounds(NamedTuple):
    """What the policy stays within."""

    log_std_min: float
    log_std_max: float
    action_limit: float


def tanh_gaussian(mean: Tensor, log_std: Tensor, noise: Tensor, bounds: Bounds) -> tuple[Tensor, Tensor]:
    """A reparametrised sample of the squashed Gaussian and its log-probability, in PyTorch's operators.

    ``u = mean + exp(log_std) * noise``, ``a = limit * tanh(u)``, with the log-std clamped to its bounds,
    ``log pi = sum_M [log N(u; mean, std) - log(1 - tanh(u)^2)]`` with the numerically stable form
    ``log(1 - tanh(u)^2) = 2 (log 2 - u - softplus(-2u))`` [SU, core.py]. As in Spinning Up the density is that of
    tanh(u): a limit other than 1 would add a constant.

    Args:
        mean: ``[B, M]``.
        log_std: ``[B, M]``, before it is clamped.
        noise: ``[B, M]``, standard normal.
        bounds: of log-std and actions.

    Returns:
        actions ``[B, M]`` and log-probabilities ``[B]``.
    """
    log_std = log_std.clamp(bounds.log_std_min, bounds.log_std_max)
    u = torch.addcmul(mean, log_std.exp(), noise)
    log_normal = -0.5 * noise * noise - log_std - _HALF_LOG_2PI
    log_probability = (log_normal - 2.0 * (_LOG_2 - u - F.softplus(-2.0 * u))).sum(dim=-1)
    return torch.tanh(u) * bounds.action_limit, log_probability


#: From the gradients to actions ``[B, M]`` and log-probabilities ``[B]`` to those of mean and log-std, ``[B, M]``.
PullSample = Callable[[Tensor, Tensor], tuple[Tensor, Tensor]]


def tanh_gaussian_vjp(
    mean: Tensor, log_std: Tensor, noise: Tensor, bounds: Bounds
) -> tuple[Tensor, Tensor, PullSample]:
    """:func:`tanh_gaussian` without graph, and its vector-Jacobian product: one kernel each for float32 on the CPU."""
    parts = mean, log_std, noise
    if all(takes_kernel(x) and x.shape == mean.shape for x in parts):
        return _fused_tanh_gaussian(mean, log_std, noise, bounds)
    with torch.enable_grad():
        mean, log_std = mean.detach().requires_grad_(), log_std.detach().requires_grad_()
        outputs = tanh_gaussian(mean, log_std, noise, bounds)

    def pull(*gradients: Tensor) -> tuple[Tensor, Tensor]:
        to_mean, to_log_std = torch.autograd.grad(outputs, [mean, log_std], gradients)
        return to_mean, to_log_std

    return outputs[0].detach(), outputs[1].detach(), pull


def _fused_tanh_gaussian(
    mean: Tensor, log_std: Tensor, noise: Tensor, bounds: Bounds
) -> tuple[Tensor, Tensor, PullSample]:
    """Some thirty small operators in a kernel."""
    shape = samples, _ = mean.shape
    action, log_probability, kept = mean.new_empty(shape), mean.new_empty(samples), mean.new_empty(2, *shape)
    mean, log_std, noise = mean.contiguous(), log_std.contiguous(), noise.contiguous()
    outputs = (action.data_ptr(), log_probability.data_ptr(), kept.data_ptr())
    sample_kernel()(*shape, mean.data_ptr(), log_std.data_ptr(), noise.data_ptr(), *bounds, *outputs)

    def pull(to_action: Tensor, to_log_probability: Tensor) -> tuple[Tensor, Tensor]:
        if to_action.shape != action.shape or to_log_probability.shape != log_probability.shape:
            raise ValueError(f"a sample is {[*action.shape]}, the gradient to it {[*to_action.shape]}")
        if not (takes_kernel(to_action) and takes_kernel(to_log_probability)):
            found = ", ".join(f"{x.dtype} on {x.device}" for x in (to_action, to_log_probability))
            raise ValueError(f"a sample is float32 on the CPU, the gradient to it {found}")
        to_action, to_log_probability = to_action.contiguous(), to_log_probability.contiguous()
        to_mean, to_log_std = mean.new_empty(shape), mean.new_empty(shape)
        inputs = (to_action.data_ptr(), to_log_probability.data_ptr(), log_std.data_ptr())
        gradient_kernel()(*shape, *inputs, *bounds, kept.data_ptr(), to_mean.data_ptr(), to_log_std.data_ptr())
        return to_mean, to_log_std

    return action, log_probability, pull


def bellman_target(
    reward: Tensor, terminated: Tensor, next_values: Tensor, next_log_probability: Tensor, discount: float, alpha: float
) -> Tensor:
    """``y = r + gamma (1 - terminated) (min(Q1', Q2') - alpha log pi(a'|s'))``; values ``[2, B]``, else ``[B]``."""
    soft_value = torch.minimum(*next_values.unbind()) - alpha * next_log_probability
    return torch.addcmul(reward, 1.0 - terminated, soft_value, value=discount)


def actor_loss(log_probability: Tensor, values: Tensor, alpha: float) -> Tensor:
    """``mean over B of alpha log pi - min(Q1, Q2)``; ``log_probability`` ``[..., B]``, ``values`` ``[2, ..., B]``."""
    return (alpha * log_probability - torch.minimum(*values.unbind())).mean(-1)
