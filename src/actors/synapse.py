"""Inter-layer connections: linear synapses, or nonlinear dendritic trees [P, ``Inter``].

A neuron with d dendritic branches sums its weighted inputs on each branch; the max over branches is taken by the
neuron (:mod:`src.actors.lif`). Each synapse lies on exactly one branch, so the weights are one dense matrix
``[n, inputs]``, as many as of a linear layer, and a branch index for each.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional as F

from src.actors.branch_weights import BranchWeights, spread
from src.actors.initialisation import Initialiser
from src.actors.partition import dendritic_partition
from src.config import DendriticConfig


class Encoded(NamedTuple):
    """What the first layer's input spikes encode."""

    strength: Tensor  # A, [B, inputs]
    coding_gradient: list[float]  # d spike_tau / d A, for tau = 1..T


class Synapse(nn.Module):
    """From the spikes of a layer to the branch currents of the next.

    Weight and bias are drawn in PyTorch's default distribution for Linear.

    Args:
        config: branches (1 is the linear synapse), bias and fan-in.
        inputs: neurons of the layer before.
        neurons: n, of this layer.
        initialiser: of this module.
        partition_seed: seed sequence of the dendritic partition.
    """

    branch: Tensor | None

    def __init__(
        self,
        config: DendriticConfig,
        inputs: int,
        neurons: int,
        initialiser: Initialiser,
        partition_seed: np.random.SeedSequence,
    ) -> None:
        super().__init__()
        self.branches = config.branches
        fan_in = inputs / self.branches if config.init_fan_in == "branch" else inputs
        bound = 1.0 / math.sqrt(fan_in)
        self.bias_per_branch = config.bias == "branch" and self.branches > 1
        self.weight = initialiser.uniform("weight", (neurons, inputs), bound)
        bias_shape = (self.branches, neurons) if self.bias_per_branch else (neurons,)
        self.bias = initialiser.uniform("bias", bias_shape, bound)
        branch = dendritic_partition(partition_seed, neurons, inputs, self.branches) if self.branches > 1 else None
        self.register_buffer("branch", branch, persistent=False)
        self._fixed = False
        self._kept: Tensor | None = None

    def branch_weights(self) -> Tensor:
        """Weights of each branch, ``[d*n, inputs]``, branch by branch, 0 where the synapse lies on another one.

        Between :meth:`fix` and :meth:`release` they are expanded once. (A version counter of the weight can't tell
        when to expand anew: the fused optimizers do not raise it.)
        """
        if self.branch is None:
            return self.weight
        if torch.is_grad_enabled() and self.weight.requires_grad:
            return BranchWeights.apply(self.weight, self.branch, self.branches)  # type: ignore[no-untyped-call]
        if not self._fixed:
            return spread(self.weight, self.branch, self.branches)
        if self._kept is None:
            self._kept = spread(self.weight, self.branch, self.branches)
        return self._kept

    def spreading(self, for_gradient: bool) -> tuple[Tensor | None, Tensor | None]:
        """Branch weights where they are at hand, or the branch of each synapse to spread them by; neither for d = 1.

        A gradient takes the branches.
        """
        if self.branch is None or not self._fixed or for_gradient:
            return None, self.branch
        return self.branch_weights(), None

    def fix(self) -> None:
        """The weights will not change until :meth:`release`."""
        self._fixed, self._kept = True, None

    def release(self) -> None:
        """The weights may change again."""
        self._fixed, self._kept = False, None

    @property
    def branch_bias(self) -> Tensor | None:
        """Bias inside the max, ``[d*n]``, or None."""
        return self.bias.flatten() if self.bias_per_branch else None

    @property
    def neuron_bias(self) -> Tensor | None:
        """Bias after the max, ``[n]``, or None."""
        return None if self.bias_per_branch else self.bias

    def forward(self, spikes: Tensor) -> Tensor:
        """Branch currents of all steps in one product, ``[T, B, inputs] -> [T, B, d*n]``."""
        return F.linear(spikes, self.branch_weights(), self.branch_bias)

    def encoded(self, spikes: Tensor, encoded: Encoded) -> Tensor:
        """:meth:`forward` on spikes that encode a strength ``[B, inputs]``, with straight-through gradient to it."""
        weight, bias = self.branch_weights(), self.branch_bias
        return EncodedCurrents.apply(encoded.strength, spikes, weight, bias, encoded.coding_gradient)  # type: ignore[no-untyped-call]

    def __getstate__(self) -> dict[str, Any]:
        return self.__dict__ | {"_fixed": False, "_kept": None}


class EncodedCurrents(torch.autograd.Function):
    """Currents of the first layer, with a gradient to the strength A that costs B rows instead of T*B.

    With ``z_tau = W I_tau`` and ``dI_tau/dA = a_tau``:  ``grad_A = (sum over tau of a_tau grad_z_tau) W``.
    """

    @staticmethod
    def forward(
        ctx: Any, strength: Tensor, spikes: Tensor, weight: Tensor, bias: Tensor | None, coding_gradient: list[float]
    ) -> Tensor:
        """``[T, B, inputs] -> [T, B, outputs]``."""
        ctx.save_for_backward(spikes, weight)
        ctx.coding_gradient = coding_gradient
        return F.linear(spikes, weight, bias)

    @staticmethod
    def backward(ctx: Any, *grads: Tensor) -> tuple[Tensor | None, None, Tensor | None, Tensor | None, None]:
        """Gradients to strength ``[B, inputs]``, weight and bias."""
        (grad,) = grads
        spikes, weight = ctx.saved_tensors
        grad_strength = grad_weight = grad_bias = None
        if ctx.needs_input_grad[0]:
            grad_strength = torch.tensordot(grad.new_tensor(ctx.coding_gradient), grad, dims=1) @ weight
        if ctx.needs_input_grad[2]:
            grad_weight = grad.flatten(0, 1).T @ spikes.flatten(0, 1)
        if ctx.needs_input_grad[3]:
            grad_bias = grad.sum(dim=(0, 1))
        return grad_strength, None, grad_weight, grad_bias, None
