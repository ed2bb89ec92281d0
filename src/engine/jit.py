"""Compiling kernels with Numba: one signature each, on first use, cached on disk.

Numba stamps a cached kernel with the file of its own function only. The cache therefore lies in a folder named by a
digest of all sources of the engine: a kernel may call what stands in another file, and a change there gives new code.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

from numba import njit
from numba.core import config as numba_config
from numba.core.compiler import Compiler

#: All kernels by name, for :mod:`src.engine.compile`.
KERNELS: dict[str, Kernel] = {}
_settings: Any = numba_config

_OPTIONS: dict[str, Any] = {"nogil": True, "boundscheck": False, "error_model": "numpy"}


class Kernel:
    """A function that is compiled for one signature at its first call."""

    def __init__(self, function: Callable[..., None], signature: Any) -> None:
        self._function, self._signature = getattr(function, "py_func", function), signature
        self._compiled: Callable[..., None] | None = None
        self.__doc__ = function.__doc__
        KERNELS[f"{function.__module__}.{function.__name__}"] = self

    def __call__(self, *arguments: Any) -> None:
        """Run it; arguments are those of the signature, unchecked but for their types."""
        if self._compiled is None:
            self.compile()
            assert self._compiled is not None
        self._compiled(*arguments)

    def compile(self) -> None:
        """Compile, or load from the cache. Where no cache can be written, each process compiles anew."""
        with suppress(Exception):  # whatever the cache's trouble is; a mistake in the function raises again below
            before = _settings.CACHE_DIR
            _settings.CACHE_DIR = str(cache_folder())
            try:
                self._compiled = njit(self._signature, cache=True, **_OPTIONS)(self._function)
                return
            finally:
                _settings.CACHE_DIR = before
        self._compiled = njit(self._signature, **_OPTIONS)(self._function)


def kernel(signature: Any) -> Callable[[Callable[..., None]], Kernel]:
    """For a function that PyTorch's side calls: ``@kernel(void(int64, ...))``; it releases the interpreter's lock.

    An :data:`inner` function can be made one too.
    """
    return lambda function: Kernel(function, signature)


#: For a function that kernels call.
inner: Callable[[Callable[..., Any]], Callable[..., Any]] = njit(error_model="numpy")


def elementwise(function: Callable[..., None]) -> Callable[..., None]:
    """For a loop over arrays that do not overlap where it writes: LLVM then uses SIMD without looking for overlaps."""
    compiled_later: Callable[..., None] = njit(error_model="numpy", pipeline_class=_NoAlias)(function)
    return compiled_later


class _NoAlias(Compiler):
    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.state.flags.noalias = True


@cache
def cache_folder() -> Path:
    """Where this version's machine code lies: below ``NUMBA_CACHE_DIR`` where that is set, else beside the sources."""
    here = Path(__file__).parent
    digest = hashlib.sha256()
    for source in sorted(here.glob("*.py")):
        digest.update(source.name.encode())
        digest.update(source.read_bytes())
    base = Path(_settings.CACHE_DIR) if _settings.CACHE_DIR else here / "__pycache__"
    return base / f"kernels-{digest.hexdigest()[:16]}"
