"""Spread the dense synaptic weights over the dendritic branches, and gather their gradient."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor

from src.actors.branch_kernel import gather_kernel, spread_kernel
from src.actors.kernels import takes_kernel


class BranchWeights(torch.autograd.Function):
    """``W_m = M_m * W``: the masked weight matrix of each branch m, one below the other.

    Args:
        weight: W, ``[n, inputs]``.
        branch: the branch of each synapse, ``[n, inputs]``, int8.
        branches: d.

    Returns:
        ``[d*n, inputs]``; the gradient of a synapse is the gradient at its own branch.
    """

    @staticmethod
    def forward(ctx: Any, weight: Tensor, branch: Tensor, branches: int) -> Tensor:
        """Each weight at its branch, 0 at the others."""
        ctx.save_for_backward(branch)
        ctx.branches = branches
        if takes_kernel(weight):
            spread = torch.empty(branches, *weight.shape)
            spread_kernel()(weight.detach().contiguous().numpy(), branch.numpy(), spread.numpy())
            return spread.flatten(0, 1)
        zero = weight.new_zeros(())
        return torch.cat([torch.where(branch == index, weight, zero) for index in range(branches)])

    @staticmethod
    def backward(ctx: Any, *grads: Tensor) -> tuple[Tensor, None, None]:
        """The gradient at each synapse's own branch."""
        (branch,) = ctx.saved_tensors
        parts = grads[0].unflatten(0, (ctx.branches, -1))
        if takes_kernel(parts):
            gathered = torch.empty(branch.shape)
            gather_kernel()(gathered.numpy(), branch.numpy(), parts.contiguous().numpy())
            return gathered, None, None
        gathered = parts[0]
        for index in range(1, ctx.branches):
            gathered = torch.where(branch == index, parts[index], gathered)
        return gathered, None, None
