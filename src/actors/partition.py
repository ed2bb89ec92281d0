"""The dendritic partition: which branch of a neuron each of its inputs lies on."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from src.config import ConfigurationError


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
