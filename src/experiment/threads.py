"""The number of CPU threads of one run: set where native libraries read it, before they load, and again in torch."""

from __future__ import annotations

import os
import sys

VARIABLES = ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS")
#: OpenMP's threads spin while they wait for each other. On a busy machine that took 9 of 10 steps per second.
PASSIVE_WAITING = {"OMP_WAIT_POLICY": "PASSIVE", "GOMP_SPINCOUNT": "0", "KMP_BLOCKTIME": "0"}


def environment(threads: int) -> dict[str, str]:
    """The variables for a process that has not loaded torch yet; what the user says about waiting stays."""
    counts = dict.fromkeys(VARIABLES, str(threads))
    if threads == 1:
        return counts
    return counts | {name: value for name, value in PASSIVE_WAITING.items() if name not in os.environ}


def set_before_torch(threads: int) -> None:
    """Set the variables of this process; they count only for libraries that are not loaded yet."""
    os.environ.update(environment(threads))


def set_in_torch(threads: int) -> None:
    """Set torch's own count, which holds whatever was loaded when. The rim itself never imports torch."""
    torch = sys.modules.get("torch")
    if torch is not None:
        torch.set_num_threads(threads)
