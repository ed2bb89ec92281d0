"""Spread the dense synaptic weights over the dendritic branches, and gather their gradient."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor
from torch.autograd.function import once_differentiable

from src.actors.kernels import takes_kernel
from src.actors.lif_kernel import gather_kernel, spread_kernel


def spread(weight: Tensor, branch: Tensor, branches: int) -> Tensor:
    """``W_m = M_m * W``: the masked weight matrix of each branch m, one below the other.

    Args:
        weight: W, ``[n, inputs]``.
        branch: the branch of each synapse, ``[n, inputs]``, int8.
        branches: d.

    Returns:
        ``[d*n, inputs]``: each weight at its branch, 0 at the others; without gradient.
    """
    weight = weight.detach()
    if takes_kernel(weight):
        matrices = torch.empty(branches, *weight.shape)
        spread_kernel()(weight.contiguous().numpy(), branch.numpy(), matrices.numpy())
        return matrices.flatten(0, 1)
    zero = weight.new_zeros(())
    return torch.cat([torch.where(branch == index, weight, zero) for index in range(branches)])


def gather(grad: Tensor, branch: Tensor, branches: int) -> Tensor:
    """The gradient at each synapse's own branch, ``[d*n, inputs] -> [n, inputs]``; arguments as for spreading."""
    parts = grad.unflatten(0, (branches, -1))
    if takes_kernel(parts):
        gathered = torch.empty(branch.shape)
        gather_kernel()(gathered.numpy(), branch.numpy(), parts.contiguous().numpy())
        return gathered
    gathered = parts[0]
    for index in range(1, branches):
        gathered = torch.where(branch == index, parts[index], gathered)
    return gathered


class BranchWeights(torch.autograd.Function):
    """:func:`spread` with its gradient."""

    @staticmethod
    def forward(ctx: Any, weight: Tensor, branch: Tensor, branches: int) -> Tensor:
        """Each weight at its branch, 0 at the others."""
        ctx.save_for_backward(branch)
        ctx.branches = branches
        return spread(weight, branch, branches)

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, *grads: Tensor) -> tuple[Tensor, None, None]:
        """The gradient at each synapse's own branch."""
        (branch,) = ctx.saved_tensors
        return gather(grads[0], branch, ctx.branches), None, None
