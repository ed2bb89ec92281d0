"""The fused spiking layer as an operator of PyTorch: ``torch.ops.spiking_actor.lif``.

It is differentiable and runs anywhere: for float32 on the CPU with the Numba kernels, else (another device, another
precision) as the plain reference. The kernels are operators of their own, without gradient: ``lif_forward``,
``lif_backward``, and ``lif_inference``, which keeps nothing for a backward pass.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import torch
from torch import Tensor
from torch.autograd.function import once_differentiable

from src.actors import lif_cpu
from src.actors.lif import LIFConstants, lif_reference


def lif(
    currents: Tensor,
    bias: Tensor | None,
    lateral: Tensor | None,
    offsets: Sequence[int],
    branches: int,
    constants: LIFConstants,
    membrane: bool = False,
) -> tuple[Tensor, Tensor | None]:
    """All T steps of a spiking layer; arguments as of :func:`src.actors.lif.lif_reference`.

    Returns:
        Spikes ``[T, B, n]``, with surrogate gradient to currents, bias and lateral weights; and, for ``membrane``, the
        membrane potentials ``[T, B, n]``, without gradient.
    """
    if currents.device.type != "cpu" or currents.dtype != torch.float32:
        spikes, potentials, _ = lif_reference(currents, bias, lateral, offsets, branches, constants)
        return spikes, potentials.detach() if membrane else None
    if torch.is_grad_enabled() and any(x is not None and x.requires_grad for x in (currents, bias, lateral)):
        return FusedLIF.apply(currents, bias, lateral, offsets, branches, constants)  # type: ignore[no-untyped-call]
    layer = (currents, bias, lateral, offsets, branches, *constants[:3])
    kernels = _kernels(currents)
    if membrane:
        return kernels.lif_forward(*layer)[:2]
    return kernels.lif_inference(*layer), None


class FusedLIF(torch.autograd.Function):
    """Forward keeps spikes, membrane potentials and largest branches; backward is one pass over them."""

    @staticmethod
    def forward(
        ctx: Any,
        currents: Tensor,
        bias: Tensor | None,
        lateral: Tensor | None,
        offsets: Sequence[int],
        branches: int,
        constants: LIFConstants,
    ) -> tuple[Tensor, Tensor]:
        """Spikes and membrane potentials."""
        spikes, potentials, branch = _kernels(currents).lif_forward(
            currents, bias, lateral, offsets, branches, *constants[:3]
        )
        ctx.save_for_backward(spikes, potentials, branch, lateral)
        ctx.layer = (offsets, branches, *constants)
        ctx.mark_non_differentiable(potentials)
        ctx.set_materialize_grads(False)
        return spikes, potentials

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, *grads: Tensor | None) -> tuple[Tensor | None, ...]:
        """Gradients to currents, bias and lateral weights."""
        if grads[0] is None:
            return (None,) * 6
        gradients = _kernels(grads[0]).lif_backward(grads[0], *ctx.saved_tensors, *ctx.layer)
        return *(g if needed else None for g, needed in zip(gradients, ctx.needs_input_grad[:3], strict=True)), *[
            None
        ] * 3


def _composite(
    currents: Tensor, bias: Tensor | None, lateral: Tensor | None, offsets: list[int], branches: int, *constants: Any
) -> tuple[Tensor, Tensor | None]:
    return lif(currents, bias, lateral, offsets, branches, LIFConstants(*constants), membrane=True)


_LIBRARY = torch.library.Library("spiking_actor", "DEF")
_LAYER = "Tensor currents, Tensor? bias, Tensor? lateral, int[] offsets, int branches"
_CONSTANTS = "float current_decay, float voltage_decay, float threshold"
_SURROGATE = f"{_CONSTANTS}, float window, bool reset_gradient, bool lateral_gradient"
_KEPT = "Tensor spikes, Tensor membrane_potential, Tensor branch"
_LIBRARY.define(f"lif({_LAYER}, {_SURROGATE}) -> (Tensor spikes, Tensor membrane_potential)")
_LIBRARY.define(f"lif_forward({_LAYER}, {_CONSTANTS}) -> ({_KEPT})")
_LIBRARY.define(f"lif_inference({_LAYER}, {_CONSTANTS}) -> Tensor")
_LIBRARY.define(
    f"lif_backward(Tensor grad, {_KEPT}, Tensor? lateral, int[] offsets, int branches, {_SURROGATE})"
    " -> (Tensor currents, Tensor bias, Tensor lateral)"
)
_LIBRARY.impl("lif", _composite, "CompositeImplicitAutograd")
for _name, _cpu, _fake in (
    ("lif_forward", lif_cpu.forward, lif_cpu.empty_forward),
    ("lif_inference", lif_cpu.inference, lif_cpu.empty_inference),
    ("lif_backward", lif_cpu.backward, lif_cpu.empty_backward),
):
    _LIBRARY.impl(_name, _cpu, "CPU")
    torch.library.register_fake(f"spiking_actor::{_name}", _fake, lib=_LIBRARY)


class _Operators:
    """The kernels through PyTorch's dispatcher."""

    lif_forward = torch.ops.spiking_actor.lif_forward.default
    lif_inference = torch.ops.spiking_actor.lif_inference.default
    lif_backward = torch.ops.spiking_actor.lif_backward.default


class _Direct:
    """The same functions without the dispatcher, whose 15 us a call are a third of a layer's time when acting."""

    lif_forward = staticmethod(lif_cpu.forward)
    lif_inference = staticmethod(lif_cpu.inference)
    lif_backward = staticmethod(lif_cpu.backward)


def _kernels(tensor: Tensor) -> Any:
    """Direct for plain tensors; subclasses (fake tensors while tracing, functorch) need the dispatcher."""
    return _Direct if type(tensor) in (Tensor, torch.nn.Parameter) else _Operators
