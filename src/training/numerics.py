"""How this process computes: the same way wherever a policy is trained, evaluated or timed."""

from __future__ import annotations

import ctypes

import torch

_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3  # of glibc's malloc.h
_LARGEST = 32 << 20  # threshold that older versions of glibc accept


def set_numerics(threads: int) -> None:
    """Set the number of CPU threads, flush denormal numbers to zero and keep freed memory.

    Adam's moments of a silent neuron decay through the denormal numbers (below 1.2e-38), on which a CPU is up to a
    hundred times slower; they change no action. A spiking layer's arrays are about a megabyte: glibc would give them
    back to the system after each use and fault every page in again.
    """
    torch.set_num_threads(threads)
    torch.set_flush_denormal(True)
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)  # glibc has it
    if mallopt is not None and mallopt(_MMAP_THRESHOLD, _LARGEST):
        mallopt(_TRIM_THRESHOLD, 1 << 30)
