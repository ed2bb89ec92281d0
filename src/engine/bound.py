"""What an actor bound to the engine offers to the fast learners."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable

import torch
from torch import Tensor

from src.actors.health import ActorHealth

#: Takes the gradient w.r.t. the raw action, ``[B, M]``; writes those w.r.t. the parameters to where they are bound.
VJP = Callable[[Tensor], None]


class NotCopyable:
    """What holds addresses: a copy would act by the original's parameters, or by freed memory."""

    def __reduce_ex__(self, protocol: object) -> str:
        raise TypeError(
            f"a {type(self).__name__} holds addresses and can't be copied or pickled: build another learner and load "
            "the state of this one"
        )


class BoundActor(NotCopyable, ABC):
    """The passes of one actor whose parameters stay where they are; autograd records none of it."""

    @abstractmethod
    def raw(self, observation: Tensor, generator: torch.Generator | None) -> Tensor:
        """Raw actions ``[G, B, M]`` of G minibatches ``[G, B, N]``, each with its own draw from the random stream."""

    @abstractmethod
    def vjp(
        self, observation: Tensor, generator: torch.Generator | None, with_health: bool
    ) -> tuple[Tensor, ActorHealth | None, VJP]:
        """:meth:`raw`, with the health and the vector-Jacobian product of the last minibatch.

        The product is to be taken before the next pass of these sizes.
        """

    def raw_action(self, observation: Tensor, generator: torch.Generator | None) -> Tensor:
        """Raw actions ``[B, M]`` for ``[B, N]``."""
        return self.raw(observation.unsqueeze(0), generator)[0]
