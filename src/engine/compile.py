"""Compile every kernel into the cache, so that no run waits for it: ``python -m src.engine.compile``.

Without this the first processes to need a kernel compile it themselves, each for itself.
"""

from __future__ import annotations

import time

from src.engine import coding, mlp_kernels, spiking_kernels, tanh_gaussian  # noqa: F401  they define the kernels
from src.engine.jit import KERNELS


def main() -> None:
    """Compile, and say how long it took."""
    started = time.perf_counter()
    for kernel in KERNELS.values():
        kernel.compile()
    print(f"{len(KERNELS)} kernels compiled in {time.perf_counter() - started:.0f} s")


if __name__ == "__main__":
    main()
