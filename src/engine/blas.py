"""The matrix product of a BLAS library, at an address that Numba kernels call.

A product of batch 100 and width 256 takes some 0.05 ms, so that what PyTorch and Python spend around each is a third of
an update. Kernels that call the products themselves spend it once per network.

Two libraries may be there: PyTorch's own MKL, where PyTorch exports it (Linux on x86), and the one behind SciPy,
OpenBLAS in its packages. MKL takes its AVX-512 path on Intel's processors only; elsewhere OpenBLAS is up to twice as
fast (docs/performance.md). So the rule is: MKL on a processor of Intel's, else OpenBLAS.

Both take Fortran's arguments: everything by address, matrices column by column. Sizes are 64 bits wide in memory, of
which a library with 32-bit integers reads the lower half.
"""

from __future__ import annotations

import ctypes
import os
import platform
from functools import cache
from pathlib import Path
from typing import Literal, NamedTuple

import torch

Choice = Literal["auto", "mkl", "openblas"]
#: The environment variable that makes OpenBLAS take other kernels than the processor's own.
OVERRIDE = "OPENBLAS_CORETYPE"


class BLASUnavailableError(ValueError):
    """The library that was asked for is not on this machine. The message is for the user."""


class Library(NamedTuple):
    """The BLAS in use."""

    name: str  # mkl, openblas, or what else SciPy brings
    version: str | None
    architecture: str | None  # of its kernels, where the library tells


_selected: dict[str, str] = {}


def select(choice: Choice = "auto", recorded: str | None = None) -> Library:
    """Choose the library of this process's products.

    Args:
        choice: ``auto`` follows the rule above.
        recorded: the library that a run began with; ``auto`` keeps it where it is there.

    Raises:
        BLASUnavailableError: there is no such library here.
    """
    wanted = preferred() if choice == "auto" else choice
    if choice == "auto" and recorded in ("mkl", "openblas") and address(recorded) is not None:
        wanted = recorded
    if address(wanted) is None:
        raise BLASUnavailableError(
            "blas=mkl: PyTorch has no MKL here (it comes with PyTorch on Linux on x86); use blas=auto or openblas."
        )
    _selected["name"] = wanted
    return library()


def preferred() -> str:
    """The library by the rule on the processor."""
    return "mkl" if _is_intel() and address("mkl") is not None else "openblas"


def library() -> Library:
    """The library in use, with its version and the architecture whose kernels it runs."""
    return _describe(_name())


def sgemm_address() -> int:
    """Where the product of the selected library lies; an argument of the kernels."""
    found = address(_name())
    assert found is not None  # select() has seen to it
    return found


def held_back() -> str | None:
    """One sentence where an environment variable makes OpenBLAS take slower kernels than this processor has."""
    setting = os.environ.get(OVERRIDE)
    if _name() != "openblas" or not setting:
        return None
    return (
        f"OpenBLAS runs its {library().architecture} kernels because of {OVERRIDE}={setting}; on a processor with "
        f"AVX-512 that costs about half of the speed of training. To run without it: env -u {OVERRIDE} "
        "python -m src.run ..."
    )


def _name() -> str:
    return _selected.setdefault("name", preferred())


@cache
def address(name: str) -> int | None:
    """Where the product of a library (``mkl`` or ``openblas``) lies; None where it is not here."""
    if name == "openblas":
        from numba.extending import get_cython_function_address  # a run on the plain path needs no Numba

        return int(get_cython_function_address("scipy.linalg.cython_blas", "sgemm"))
    path = Path(torch.__file__).parent / "lib" / "libtorch_cpu.so"
    if torch.backends.mkl.is_available() and path.exists():
        function = getattr(ctypes.CDLL(str(path)), "sgemm_", None)
        return None if function is None else ctypes.cast(function, ctypes.c_void_p).value
    return None


@cache
def _is_intel() -> bool:
    try:
        with Path("/proc/cpuinfo").open() as lines:
            return any(line.startswith("vendor_id") and "GenuineIntel" in line for line in lines)
    except OSError:  # not Linux
        return "Intel" in platform.processor()


@cache
def _describe(name: str) -> Library:
    if name == "mkl":
        lines = [line for line in torch.__config__.show().splitlines() if "Math Kernel Library Version" in line]
        version = lines[0].split("Version", 1)[1].split()[0] if lines else None
        return Library("mkl", version, None)
    from threadpoolctl import threadpool_info  # it finds the library only once SciPy has loaded it

    for found in threadpool_info():
        if found["user_api"] == "blas" and any(
            "scipy" in part.lower() for part in Path(found["filepath"]).parts[-4:-1]
        ):
            return Library(found["internal_api"], found["version"], found.get("architecture"))
    return Library("unknown", None, None)  # SciPy's, which threadpoolctl does not know (Apple's Accelerate)
