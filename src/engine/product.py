"""The matrix product inside kernels, by the function of a BLAS library at an address (:mod:`src.engine.blas`)."""

from __future__ import annotations

from typing import Any

import numpy as np
from llvmlite import ir
from numba import int64, types
from numba.extending import intrinsic

from src.engine.jit import inner


@intrinsic
def call_sgemm(typing_context, address, flags, sizes, factors, a, b, c):  # type: ignore[no-untyped-def]
    """``C = alpha op(A) op(B) + beta C`` of the function at ``address``, column by column.

    ``flags`` holds transa and transb (uint8), ``sizes`` m, n, k, lda, ldb, ldc (int64), ``factors`` alpha and beta
    (float32); a, b, c are addresses.
    """
    signature = types.void(address, flags, sizes, factors, a, b, c)
    return signature, _generate_call


def _generate_call(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    function, _, _, _, a, b, c = arguments
    word = ir.IntType(64)

    def item(position: int, index: int) -> Any:
        array = context.make_array(signature.args[position])(context, builder, arguments[position])
        return builder.ptrtoint(builder.gep(array.data, [ir.Constant(word, index)]), word)

    m, n, k, lda, ldb, ldc = (item(2, index) for index in range(6))
    transa, transb, alpha, beta = item(1, 0), item(1, 1), item(3, 0), item(3, 1)
    kind = ir.FunctionType(ir.VoidType(), [word] * 13)
    pointer = builder.inttoptr(function, kind.as_pointer())
    builder.call(pointer, [transa, transb, m, n, k, alpha, a, lda, b, ldb, beta, c, ldc])
    return context.get_dummy_value()


@inner
def multiply(sgemm, n, m, k, a, lda, a_transposed, b, ldb, b_transposed, c, ldc, accumulate):  # type: ignore[no-untyped-def]
    """``C[n, m] (+)= op(A)[n, k] op(B)[k, m]``, row by row: Fortran's ``C^T = op(B)^T op(A)^T``.

    a, b, c and sgemm are addresses; lda, ldb, ldc the lengths of rows; ``accumulate`` is 1 to add to C, else 0.
    """
    sizes = np.array([m, n, k, ldb, lda, ldc], np.int64)
    factors = np.array([1, accumulate], np.float32)
    flags = np.array([ord("T") if b_transposed else ord("N"), ord("T") if a_transposed else ord("N")], np.uint8)
    call_sgemm(sgemm, flags, sizes, factors, b, a, c)


@inner
def product(sgemm, a, a_transposed, b, b_transposed, c):  # type: ignore[no-untyped-def]
    """``C = op(A) op(B)`` of contiguous arrays."""
    rows, columns = c.shape
    count = a.shape[0] if a_transposed else a.shape[1]
    multiply(
        sgemm, rows, columns, count, int64(a.ctypes.data), a.shape[1], a_transposed, int64(b.ctypes.data), b.shape[1],
        b_transposed, int64(c.ctypes.data), columns, np.float32(0),
    )  # fmt: skip
