"""A spiking layer as one node of autograd's graph and one call of a compiled kernel in each direction.

Values and gradients are those of :class:`src.actors.synapse.Synapse` followed by :func:`src.actors.lif_op.lif`, bit
for bit; those serve wherever this does not.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor
from torch.autograd.function import once_differentiable

from src.actors.lif import LIFConstants
from src.actors.lif_cpu import as_array, no_rows, offsets_array
from src.actors.lif_kernel import layer_backward_kernel, layer_forward_kernel


class Encoded(NamedTuple):
    """What the first layer's input spikes encode."""

    strength: Tensor  # A, [B, inputs]
    coding_gradient: list[float]  # d spike_tau / d A, for tau = 1..T


class Structure(NamedTuple):
    """What a layer does not learn."""

    matrix: Tensor | None  # the branch weights [d*n, inputs]; None: to be spread from the weight
    branch: Tensor | None  # of each synapse, [n, inputs], int8, where the weight is to be spread
    branches: int  # d
    offsets: Sequence[int]  # of the lateral weights
    constants: LIFConstants


def fused_layer(
    encoded: Encoded | None,
    spikes: Tensor,
    weight: Tensor,
    bias: Tensor,
    lateral: Tensor | None,
    structure: Structure,
    membrane: bool,
) -> tuple[Tensor, Tensor | None]:
    """All T steps of a layer, for plain float32 tensors on the CPU.

    Args:
        encoded: of the first layer, whose input's gradient goes to the strength instead.
        spikes: of the layer before, ``[T, B, inputs]``.
        weight: ``[n, inputs]``.
        bias: of the neurons, ``[n]``, after the max.
        lateral: ``[K, n]`` or None.
        structure: the rest.
        membrane: whether to give membrane potentials.

    Returns:
        Spikes ``[T, B, n]``; and, for ``membrane`` or a gradient, the membrane potentials, without gradient.
    """
    if not torch.is_grad_enabled():
        fired, potentials, *_ = _forward(spikes, weight, bias, lateral, structure, membrane)
        return fired, potentials if membrane else None
    strength, coding_gradient = (None, None) if encoded is None else encoded
    return _FusedLayer.apply(strength, spikes, weight, bias, lateral, coding_gradient, structure)  # type: ignore[no-untyped-call, no-any-return]


class _FusedLayer(torch.autograd.Function):
    """It keeps what its backward pass reads; the currents and their gradient live inside the kernels only."""

    @staticmethod
    def forward(
        ctx: Any,
        strength: Tensor | None,
        spikes: Tensor,
        weight: Tensor,
        bias: Tensor,
        lateral: Tensor | None,
        coding_gradient: list[float] | None,
        structure: Structure,
    ) -> tuple[Tensor, Tensor]:
        """Spikes and membrane potentials."""
        fired, potentials, winners, matrix = _forward(spikes, weight, bias, lateral, structure, keep=True)
        ctx.save_for_backward(spikes, matrix, fired, potentials, winners, lateral)
        ctx.coding_gradient, ctx.structure = coding_gradient, structure
        ctx.mark_non_differentiable(potentials)
        ctx.set_materialize_grads(False)
        return fired, potentials

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, *grads: Tensor | None) -> tuple[Tensor | None, ...]:
        """Gradients to strength ``[B, inputs]`` or spikes, weight, bias and lateral weights.

        With ``z_tau = W I_tau`` and ``dI_tau/dA = a_tau``, ``grad_A = (sum over tau of a_tau grad_z_tau) W``.
        """
        if grads[0] is None:
            return (None,) * 7
        spikes, matrix, fired, potentials, winners, lateral = ctx.saved_tensors
        steps, samples, inputs = spikes.shape
        neurons, structure = fired.shape[2], ctx.structure
        to_strength, to_spikes, to_weight, to_bias, to_lateral, *_ = ctx.needs_input_grad
        rows = samples if to_strength else steps * samples if to_spikes else 0
        grad_x, grad_weight = torch.empty(rows, inputs), torch.empty(neurons, inputs)
        grad_bias, grad_lateral = torch.zeros(neurons), torch.zeros(len(structure.offsets), neurons)
        layer_backward_kernel()(
            as_array(grads[0]),
            _rows(spikes),
            _NO_BRANCH if structure.branch is None else structure.branch.numpy(),
            as_array(matrix),
            fired.numpy(),
            potentials.numpy(),
            winners.numpy(),
            no_rows(neurons) if lateral is None else as_array(lateral),
            offsets_array(structure.offsets),
            *structure.constants,
            np.array([ctx.coding_gradient], np.float32) if to_strength else _NO_ROWS,
            grad_x.numpy(),
            grad_weight.numpy(),
            grad_bias.numpy(),
            grad_lateral.numpy(),
        )
        return (
            grad_x if to_strength else None,
            grad_x.view(spikes.shape) if to_spikes else None,
            grad_weight if to_weight else None,
            grad_bias if to_bias else None,
            grad_lateral if to_lateral else None,
            None,
            None,
        )


def _forward(
    spikes: Tensor, weight: Tensor, bias: Tensor, lateral: Tensor | None, structure: Structure, keep: bool
) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """Spikes, potentials and largest branches (both empty unless kept), and the branch weights."""
    matrix, branch, branches, offsets, constants = structure
    steps, samples, _ = spikes.shape
    neurons = bias.shape[0]
    shape = (steps, samples, neurons)
    fired, potentials = torch.empty(shape), torch.empty(shape if keep else (0, 0, 0))
    winners = torch.empty(shape if keep and branches > 1 else (0, 0, 0), dtype=torch.int8)
    if matrix is None:
        matrix = torch.empty(branches * neurons, weight.shape[1])
    layer_forward_kernel()(
        _rows(spikes),
        as_array(weight),
        _NO_BRANCH if branch is None else branch.numpy(),
        as_array(matrix),
        as_array(bias),
        no_rows(neurons) if lateral is None else as_array(lateral),
        offsets_array(offsets),
        *constants[:3],
        fired.numpy(),
        potentials.numpy(),
        winners.numpy(),
    )
    return fired, potentials, winners, matrix


def _rows(spikes: Tensor) -> np.ndarray:
    return as_array(spikes).reshape(-1, spikes.shape[2])


_NO_ROWS, _NO_BRANCH = np.zeros((0, 0), np.float32), np.zeros((0, 0), np.int8)
