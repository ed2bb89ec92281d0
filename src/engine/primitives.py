"""What kernels are made of beside loops: arrays at addresses, scratch memory, a BLAS library's matrix product."""

from __future__ import annotations

from typing import Any

import numpy as np
from llvmlite import ir
from numba import carray, float32, int64, types, uint8
from numba.core import cgutils
from numba.extending import intrinsic

from src.engine.jit import inner

LINE = 64  # bytes of a cache line, at which every buffer begins: a product's bits may hang on its alignment
FLOAT = 4  # bytes of a float32


@intrinsic
def _pointer(typing_context, address):  # type: ignore[no-untyped-def]
    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.inttoptr(arguments[0], context.get_value_type(signature.return_type))

    return types.voidptr(int64), code


@inner
def floats(address, shape):  # type: ignore[no-untyped-def]
    """The float32 array of that shape at an address."""
    return carray(_pointer(address), shape, np.float32)


@inner
def bytes_(address, shape):  # type: ignore[no-untyped-def]
    """The int8 array of that shape at an address."""
    return carray(_pointer(address), shape, np.int8)


@inner
def aligned(count):  # type: ignore[no-untyped-def]
    """``count`` uninitialised floats that begin at a cache line."""
    memory = np.empty(count + LINE // FLOAT, np.float32)
    start = -int64(memory.ctypes.data) % LINE // FLOAT
    return memory[start : start + count]


@inner
def next_line(address):  # type: ignore[no-untyped-def]
    """The first multiple of a cache line from there on."""
    return (address + LINE - 1) // LINE * LINE


@inner
def keep_alive(array):  # type: ignore[no-untyped-def]
    """Numba frees an array after its last mention: one that is used by its address is mentioned after that."""
    return array.shape[0]


@intrinsic
def _sgemm(typing_context, function, a, b, c, transa, transb, m, n, k, lda, ldb, ldc, alpha, beta):  # type: ignore[no-untyped-def]
    """Fortran's ``C = alpha op(A) op(B) + beta C``, column by column; function, a, b, c are addresses."""

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        function, a, b, c, *scalars = arguments
        transa, transb, m, n, k, lda, ldb, ldc, alpha, beta = (
            builder.ptrtoint(cgutils.alloca_once_value(builder, value), ir.IntType(64)) for value in scalars
        )
        by_address = [transa, transb, m, n, k, alpha, a, lda, b, ldb, beta, c, ldc]
        kind = ir.FunctionType(ir.VoidType(), [ir.IntType(64)] * len(by_address))
        builder.call(builder.inttoptr(function, kind.as_pointer()), by_address)
        return context.get_dummy_value()

    return types.void(*4 * (int64,), *2 * (uint8,), *6 * (int64,), *2 * (float32,)), code


@inner
def multiply(sgemm, n, m, k, a, lda, a_transposed, b, ldb, b_transposed, c, ldc, accumulate):  # type: ignore[no-untyped-def]
    """``C[n, m] (+)= op(A)[n, k] op(B)[k, m]``, row by row: Fortran's ``C^T = op(B)^T op(A)^T``.

    a, b, c and sgemm are addresses; lda, ldb, ldc the lengths of rows; ``accumulate`` is 1 to add to C, else 0.
    """
    transb, transa = ord("T") if b_transposed else ord("N"), ord("T") if a_transposed else ord("N")
    _sgemm(sgemm, b, a, c, transb, transa, m, n, k, ldb, lda, ldc, 1, accumulate)


@inner
def product(sgemm, a, a_transposed, b, b_transposed, c):  # type: ignore[no-untyped-def]
    """``C = op(A) op(B)`` of contiguous arrays."""
    rows, columns = c.shape
    count = a.shape[0] if a_transposed else a.shape[1]
    multiply(
        sgemm, rows, columns, count, int64(a.ctypes.data), a.shape[1], a_transposed, int64(b.ctypes.data), b.shape[1],
        b_transposed, int64(c.ctypes.data), columns, 0,
    )  # fmt: skip
