"""Compiling Numba kernels: one signature each, on first use, cached on disk where that is possible.

Numba watches only the source file of the function it compiles: what a kernel calls must stand in the kernel's file,
or an old cache would outlive a change. Not so the pointers and :func:`disjoint` below and the product of
:mod:`src.blas`: who changes what they do gives them another name.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import torch
from numba import njit, types
from numba.core.compiler import Compiler
from numba.extending import intrinsic


def compiled(function: Callable[..., None], signature: Any) -> Callable[..., None]:
    """Compile for one signature, releasing the interpreter's lock, without fastmath.

    Where no cache can be written (or a full disk or a broken file spoils it), each process compiles anew.
    """
    options: dict[str, Any] = {"nogil": True, "boundscheck": False, "error_model": "numpy"}
    try:
        return njit(signature, cache=True, **options)(function)
    except Exception:  # whatever the cache's trouble is; a mistake in the function raises again below
        return njit(signature, **options)(function)


def disjoint(function: Callable[..., None]) -> Callable[..., None]:
    """For kernels: a loop over arrays none of which, where it writes, overlaps another. LLVM then uses SIMD without
    looking for overlaps at each call.
    """
    compiled_later: Callable[..., None] = njit(error_model="numpy", pipeline_class=_Disjoint)(function)
    return compiled_later


class _Disjoint(Compiler):
    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.state.flags.noalias = True


@intrinsic
def floats_at(typing_context, address):  # type: ignore[no-untyped-def]
    """An address as a pointer to float32; for kernels, with ``carray``."""
    return _pointer(types.float32)


@intrinsic
def bytes_at(typing_context, address):  # type: ignore[no-untyped-def]
    """An address as a pointer to int8."""
    return _pointer(types.int8)


def _pointer(item: Any) -> tuple[Any, Callable[..., Any]]:
    signature = types.CPointer(item)(types.int64)

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.inttoptr(arguments[0], context.get_value_type(signature.return_type))

    return signature, code


def takes_kernel(tensor: torch.Tensor) -> bool:
    """Kernels serve plain float32 tensors on the CPU; others, tracing among them, take PyTorch's own operators."""
    return tensor.device.type == "cpu" and tensor.dtype == torch.float32 and type(tensor) in _PLAIN


def as_array(tensor: torch.Tensor) -> np.ndarray:
    """Its values, contiguous."""
    return tensor.detach().contiguous().numpy()


_PLAIN = (torch.Tensor, torch.nn.Parameter)
