"""The number of CPU threads of one run: set where native libraries read it, before they load, and again in torch."""

from __future__ import annotations

import os
import sys

VARIABLES = ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS")


def environment(threads: int) -> dict[str, str]:
    """The variables for a process that has not loaded torch yet."""
    return dict.fromkeys(VARIABLES, str(threads))


def set_before_torch(threads: int) -> None:
    """Set the variables of this process; they count only for libraries that are not loaded yet."""
    os.environ.update(environment(threads))


def set_in_torch(threads: int) -> None:
    """Set torch's own count, which holds whatever was loaded when. The rim itself never imports torch."""
    torch = sys.modules.get("torch")
    if torch is not None:
        torch.set_num_threads(threads)
