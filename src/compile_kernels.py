"""Compile every kernel into Numba's cache, so that no run waits for it: ``python -m src.compile_kernels``.

Without this the first processes to need a kernel compile it themselves, each for itself.
"""

from __future__ import annotations

import importlib
import inspect
import pkgutil
import time
from types import ModuleType

import src


def main() -> None:
    """Compile, and say how long it took."""
    started = time.perf_counter()
    names = [info.name for info in pkgutil.walk_packages(src.__path__, "src.") if info.name.endswith("_kernel")]
    count = sum(compile_module(importlib.import_module(name)) for name in sorted(names))
    print(f"{count} kernels compiled in {time.perf_counter() - started:.0f} s")


def compile_module(module: ModuleType) -> int:
    """Call each ``..._kernel()`` that the module defines; how many there are."""
    kernels = [
        function
        for name, function in inspect.getmembers(module, callable)
        if name.endswith("_kernel") and inspect.unwrap(function).__module__ == module.__name__
    ]
    for kernel in kernels:
        kernel()
    return len(kernels)


if __name__ == "__main__":
    main()
