"""How this process computes: the same way wherever a policy is trained, evaluated or timed."""

from __future__ import annotations

import torch


def set_numerics(threads: int) -> None:
    """Set the number of CPU threads and flush denormal numbers to zero.

    Adam's moments of a silent neuron decay through the denormal numbers (below 1.2e-38), on which a CPU is up to a
    hundred times slower; they change no action.
    """
    torch.set_num_threads(threads)
    torch.set_flush_denormal(True)
