"""Compile every kernel into the cache, so that no run waits for it: ``python -m src.engine.compile``.

Without this the first processes to need a kernel compile it themselves, each for itself.
"""

from __future__ import annotations

import shutil
import time
from pathlib import Path

from src.engine import coding, mlp_kernels, spiking_kernels, tanh_gaussian  # noqa: F401  they define the kernels
from src.engine.jit import KERNELS, cache_folder


def main() -> None:
    """Compile, delete the machine code of older sources, and say how long it took."""
    started = time.perf_counter()
    for kernel in KERNELS.values():
        kernel.compile()
    for folder in (Path(__file__).parent / "__pycache__").glob("kernels-*"):
        if folder != cache_folder():  # of other versions of the sources, where the cache is this checkout's own
            shutil.rmtree(folder, ignore_errors=True)
    print(f"{len(KERNELS)} kernels compiled in {time.perf_counter() - started:.0f} s")


if __name__ == "__main__":
    main()
