"""What an actor bound to the engine offers to the fast learners."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import torch
from torch import Tensor

from src.actors.health import ActorHealth

#: From the gradient to the raw action ``[B, M]`` to those of the parameters, filled.
VJP = Callable[[Tensor], None]


class BoundActor(Protocol):
    """The passes of one actor whose parameters stay where they are; autograd records none of it."""

    def refresh(self) -> None:
        """To be called when the parameters have changed, before :meth:`act`."""

    def act(self, observation: Tensor, generator: torch.Generator | None) -> Tensor:
        """Raw actions ``[B, M]`` for ``[B, N]`` by the parameters as they were at the last :meth:`refresh`."""

    def raw(self, observation: Tensor, generator: torch.Generator | None) -> Tensor:
        """Raw actions ``[G, B, M]`` of G minibatches ``[G, B, N]``, each with its own draw from the random stream."""

    def vjp(
        self, observation: Tensor, generator: torch.Generator | None, with_health: bool
    ) -> tuple[Tensor, ActorHealth | None, VJP]:
        """Raw actions ``[G, B, M]``; health and vector-Jacobian product of the last minibatch."""


class NotCopyable:
    """What holds addresses: a copy would act by the original's parameters, or by freed memory."""

    def __reduce_ex__(self, protocol: object) -> str:
        raise TypeError(
            f"a {type(self).__name__} holds addresses and can't be copied or pickled: build another learner and load "
            "the state of this one"
        )
