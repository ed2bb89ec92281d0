"""Inter-layer connections: linear synapses, or nonlinear dendritic trees [P, ``Inter``].

    z_m = sum over the inputs i on branch m of w_i o_i,   Inter = max over branches m of z_m + b

Each synapse lies on exactly one of a neuron's d dendritic branches. So there are as many weights as of a linear layer
(d = 1): a dense matrix ``[n, inputs]``, and the branch index of each.
"""

from __future__ import annotations

import math

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional as F

from src.actors.initialisation import Initialiser
from src.config.schema import ConfigurationError, DendriticConfig


class Synapse(nn.Module):
    """From the spikes of a layer to the input currents of the next.

    Weight and bias are drawn in PyTorch's default distribution for Linear.

    Args:
        config: branches (1 is the linear synapse), bias and fan-in.
        inputs: neurons of the layer before.
        neurons: n, of this layer.
        initialiser: of this module.
        partition_seed: seed sequence of the dendritic partition.
    """

    branch: Tensor | None  # of each synapse, [n, inputs]; None for the linear synapse

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

    def branch_weights(self) -> Tensor:
        """Weights of each branch, ``[d*n, inputs]``, branch by branch; 0 where the synapse lies on another one."""
        if self.branch is None:
            return self.weight
        return torch.cat([torch.where(self.branch == m, self.weight, 0.0) for m in range(self.branches)])

    def forward(self, spikes: Tensor) -> Tensor:
        """Input currents of all steps in one product, ``[T, B, inputs] -> [T, B, n]``."""
        z = F.linear(spikes, self.branch_weights()).unflatten(-1, (self.branches, -1))  # [T, B, d, n]
        if self.bias_per_branch:
            return maxout(z + self.bias)
        return maxout(z) + self.bias


def maxout(currents: Tensor) -> Tensor:
    """Max over dendritic branches, ``[T, B, d, n] -> [T, B, n]``; of equal branches the first takes the gradient."""
    return currents.max(dim=-2).values


def dendritic_partition(sequence: np.random.SeedSequence, outputs: int, inputs: int, branches: int) -> Tensor:
    """Split the inputs of each neuron at random into disjoint branches whose sizes differ by at most one.

    Every neuron gets its own split: exclusive (an input lies on one branch) and exhaustive (on exactly one). The split
    is not stored but regenerated from the seed. It is made of the raw words of PCG64 and a stable sort, whose results
    NumPy guarantees over its versions (unlike those of ``Generator``'s methods), so that an old policy stays playable.

    Returns:
        Branch index of each synapse, ``[outputs, inputs]``, int8, in ``0..branches-1``.

    Raises:
        ConfigurationError: more branches than inputs (a branch would be empty), or more than 127.
    """
    if branches > inputs:
        raise ConfigurationError(f"actor.dendritic.branches: {branches} exceeds the {inputs} inputs of a layer.")
    if branches > 127:
        raise ConfigurationError(f"actor.dendritic.branches: {branches} exceeds 127.")
    words = np.random.PCG64(sequence).random_raw(outputs * inputs).reshape(outputs, inputs)
    order = np.argsort(words, axis=1, kind="stable")
    branch = np.empty((outputs, inputs), dtype=np.int8)
    np.put_along_axis(branch, order, (np.arange(inputs) % branches).astype(np.int8)[None, :], axis=1)
    return torch.from_numpy(branch)
