"""What :func:`src.algorithms.build.build_learner` asks of the engine: which actors it supports; its algorithms."""

from __future__ import annotations

from collections.abc import Callable

import torch
from torch import Tensor

from src.actors.actor import Actor
from src.engine import sac, td3
from src.engine.binding import bind, unsupported_algorithm, unsupported_reason
from src.engine.flat import FlatParameters

TD3, SAC = td3.FastTD3, sac.FastSAC

__all__ = ["SAC", "TD3", "acting", "unsupported_algorithm", "unsupported_reason"]


def acting(actor: Actor) -> Callable[[Tensor, torch.Generator], Tensor]:
    """The actor's output ``[B, M]`` for ``[B, N]`` as a fast learner acts.

    Its parameters move into a flat tensor, as a learner's do.
    """
    FlatParameters(actor.parameters())
    return bind(actor).act
