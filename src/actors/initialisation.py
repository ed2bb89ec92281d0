"""Initial parameters: each from its own stream, so that a layer more or less moves no other layer's weights."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import nn

from src.streams import Streams


class Initialiser:
    """Draws parameters from ``streams.torch("initialisation", "<prefix>.<name>")``.

    Args:
        streams: the run's random streams.
        prefix: the path of the module, e.g. ``"actor.layers.0"``.
    """

    def __init__(self, streams: Streams, prefix: str = "actor") -> None:
        self._streams = streams
        self._prefix = prefix

    def at(self, name: str) -> Initialiser:
        """The initialiser of a submodule."""
        return Initialiser(self._streams, f"{self._prefix}.{name}")

    def uniform(self, name: str, shape: Sequence[int], bound: float) -> nn.Parameter:
        """A parameter drawn from U(-bound, bound); with ``bound = 1 / sqrt(fan_in)`` PyTorch's default for Linear."""
        generator = self._streams.torch("initialisation", f"{self._prefix}.{name}")
        return nn.Parameter(torch.empty(*shape).uniform_(-bound, bound, generator=generator))
