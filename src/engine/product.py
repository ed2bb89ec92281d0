"""The matrix product of the selected BLAS (:mod:`src.engine.blas`), inside kernels."""

from __future__ import annotations

import numpy as np
from numba import int64

from src.engine.blas import call_sgemm
from src.engine.jit import inner


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
