"""The matrix product of a BLAS library as a function that Numba kernels can call by name.

A product of batch 100 and width 256 takes about 0.1 ms, so that what PyTorch and Python spend around each is a third of
an update. Kernels that call the products themselves (:mod:`src.ensemble_mlp_kernel`) spend it once per network.

The library is PyTorch's own MKL where PyTorch exports it (Linux on x86), else the one behind SciPy, found in the way
Numba documents. Both take Fortran's arguments: everything by address, matrices column by column. Sizes are 64 bits wide
in memory, of which a library with 32-bit integers reads the lower half.
"""

from __future__ import annotations

import ctypes
from pathlib import Path

import llvmlite.binding
import torch
from numba import float32, int64, types, uint8
from numba.extending import get_cython_function_address

_SYMBOL = "spiking_actor_sgemm"  # cached kernels hold it: other arguments need another name


def _address() -> tuple[int, str]:
    """Where the function lies, and the library's name."""
    path = Path(torch.__file__).parent / "lib" / "libtorch_cpu.so"
    if torch.backends.mkl.is_available() and path.exists():
        function = getattr(ctypes.CDLL(str(path)), "sgemm_", None)
        if function is not None and (address := ctypes.cast(function, ctypes.c_void_p).value):
            return address, "MKL of PyTorch"
    return get_cython_function_address("scipy.linalg.cython_blas", "sgemm"), "BLAS of SciPy"


_found, LIBRARY = _address()
llvmlite.binding.add_symbol(_SYMBOL, _found)

_int, _float, _flag = types.CPointer(int64), types.CPointer(float32), types.CPointer(uint8)

#: ``sgemm(transa, transb, m, n, k, alpha, a, lda, b, ldb, beta, c, ldc)``: ``C = alpha op(A) op(B) + beta C``.
sgemm = types.ExternalFunction(
    _SYMBOL,
    types.void(_flag, _flag, _int, _int, _int, _float, _float, _int, _float, _int, _float, _float, _int),
)
