"""The kernels' operators on the CPU: from tensors to the arrays that Numba takes, and back.

``lif_forward`` gives spikes, membrane potentials and largest branches; ``lif_inference`` the spikes alone, and writes
nothing else; ``lif_backward`` the gradients to currents, bias and lateral weights.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np
import torch
from torch import Tensor

from src.actors.kernels import as_array
from src.actors.lif_kernel import backward_kernel, forward_kernel


def forward(
    currents: Tensor,
    bias: Tensor | None,
    lateral: Tensor | None,
    offsets: Sequence[int],
    branches: int,
    *constants: float,
) -> tuple[Tensor, Tensor, Tensor]:
    """Operator ``lif_forward``; constants are d_c, d_v, v_th."""
    spikes, potentials, branch = empty_forward(currents, bias, lateral, offsets, branches)
    _scan(currents, bias, lateral, offsets, branches, constants, spikes, potentials.numpy(), branch.numpy())
    return spikes, potentials, branch


def inference(
    currents: Tensor,
    bias: Tensor | None,
    lateral: Tensor | None,
    offsets: Sequence[int],
    branches: int,
    *constants: float,
) -> Tensor:
    """Operator ``lif_inference``; constants are d_c, d_v, v_th."""
    spikes = empty_inference(currents, bias, lateral, offsets, branches)
    _scan(currents, bias, lateral, offsets, branches, constants, spikes, _NOTHING, _NO_BRANCH)
    return spikes


def _scan(
    currents: Tensor,
    bias: Tensor | None,
    lateral: Tensor | None,
    offsets: Sequence[int],
    branches: int,
    constants: Sequence[float],
    spikes: Tensor,
    potentials: np.ndarray,
    branch: np.ndarray,
) -> None:
    steps, samples, neurons = spikes.shape
    z = currents.detach().contiguous().numpy().reshape(steps, samples, branches, neurons)
    forward_kernel()(
        z,
        no_rows(neurons),
        _zero_row(neurons) if bias is None else as_array(bias),
        no_rows(neurons) if lateral is None else as_array(lateral),
        offsets_array(offsets),
        *(np.float32(constant) for constant in constants),
        spikes.numpy(),
        potentials,
        branch,
    )


def backward(
    grad: Tensor,
    spikes: Tensor,
    potentials: Tensor,
    branch: Tensor,
    lateral: Tensor | None,
    offsets: Sequence[int],
    branches: int,
    *constants: float,
) -> tuple[Tensor, Tensor, Tensor]:
    """Operator ``lif_backward``; constants are all of LIFConstants."""
    steps, samples, neurons = spikes.shape
    grad_currents = spikes.new_empty(steps, samples, branches * neurons)
    grad_bias, grad_lateral = spikes.new_zeros(neurons), spikes.new_zeros(len(offsets), neurons)
    backward_kernel()(
        as_array(grad),
        spikes.numpy(),
        potentials.numpy(),
        branch.numpy(),
        no_rows(neurons) if lateral is None else as_array(lateral),
        offsets_array(offsets),
        *(np.float32(constant) for constant in constants),
        grad_currents.numpy().reshape(steps, samples, branches, neurons),
        no_rows(neurons),
        grad_bias.numpy(),
        grad_lateral.numpy(),
    )
    return grad_currents, grad_bias, grad_lateral


def offsets_array(offsets: Sequence[int]) -> np.ndarray:
    """The offsets of neighbours as the kernels take them."""
    return _offsets(tuple(offsets))


@cache
def _offsets(offsets: tuple[int, ...]) -> np.ndarray:
    return np.array(offsets, dtype=np.int64)


@cache
def _zero_row(neurons: int) -> np.ndarray:
    return np.zeros(neurons, np.float32)


@cache
def no_rows(neurons: int) -> np.ndarray:
    """Lateral weights of a layer without them."""
    return np.zeros((0, neurons), np.float32)


_NOTHING, _NO_BRANCH = np.zeros((0, 0, 0), np.float32), np.zeros((0, 0, 0), np.int8)


def empty_forward(
    currents: Tensor,
    bias: Tensor | None,
    lateral: Tensor | None,
    offsets: Sequence[int],
    branches: int,
    *constants: float,
) -> tuple[Tensor, Tensor, Tensor]:
    """Outputs of ``lif_forward``, uninitialised: shapes and types only."""
    steps, samples, width = currents.shape
    shape = (steps, samples, width // branches)
    # A linear layer has one branch: nothing to remember.
    branch = currents.new_empty(shape if branches > 1 else (0, 0, 0), dtype=torch.int8)
    return currents.new_empty(shape), currents.new_empty(shape), branch


def empty_inference(
    currents: Tensor,
    bias: Tensor | None,
    lateral: Tensor | None,
    offsets: Sequence[int],
    branches: int,
    *constants: float,
) -> Tensor:
    """Outputs of ``lif_inference``, uninitialised."""
    steps, samples, width = currents.shape
    return currents.new_empty(steps, samples, width // branches)


def empty_backward(
    grad: Tensor,
    spikes: Tensor,
    potentials: Tensor,
    branch: Tensor,
    lateral: Tensor | None,
    offsets: Sequence[int],
    branches: int,
    *constants: float,
) -> tuple[Tensor, Tensor, Tensor]:
    """Outputs of ``lif_backward``, uninitialised."""
    steps, samples, neurons = spikes.shape
    currents = grad.new_empty(steps, samples, branches * neurons)
    return currents, grad.new_empty(neurons), grad.new_empty(len(offsets), neurons)
