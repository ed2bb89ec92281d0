"""Named random streams: every source of randomness has its own, all derived from the run's seed.

A stream is identified by its name alone, so drawing more or less from one stream, or adding another, moves no other.
"""

from __future__ import annotations

import hashlib

import numpy as np
import torch


class Streams:
    """Random streams of one run.

    Args:
        seed: the run's seed, a non-negative integer. Zero is a seed like any other.
    """

    def __init__(self, seed: int) -> None:
        self.seed = seed

    def sequence(self, *name: str | int) -> np.random.SeedSequence:
        """The seed sequence of a stream, e.g. ``sequence("initialisation", "actor.layers.0.synapse.weight")``."""
        digest = hashlib.sha256("/".join(str(part) for part in name).encode()).digest()
        spawn_key = tuple(int.from_bytes(digest[i : i + 4], "little") for i in range(0, 16, 4))
        return np.random.SeedSequence(self.seed, spawn_key=spawn_key)

    def integer(self, *name: str | int) -> int:
        """A 31-bit seed, for libraries that take an integer (Gymnasium)."""
        return int(self.sequence(*name).generate_state(1, np.uint32)[0] >> 1)

    def torch(self, *name: str | int) -> torch.Generator:
        """A fresh CPU generator of PyTorch for the stream."""
        generator = torch.Generator()
        generator.manual_seed(int(self.sequence(*name).generate_state(1, np.uint64)[0] >> 1))
        return generator

    def numpy(self, *name: str | int) -> np.random.Generator:
        """A fresh NumPy generator for the stream."""
        return np.random.default_rng(self.sequence(*name))
