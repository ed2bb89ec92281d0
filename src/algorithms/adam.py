"""Adam on one flat tensor, without the bookkeeping of ``torch.optim`` around PyTorch's own fused kernel.

    m <- b1 m + (1 - b1) g,   v <- b2 v + (1 - b2) g^2,   x <- x - lr m_hat / (sqrt(v_hat) + eps)

Betas (0.9, 0.999) and eps 1e-8 are PyTorch's defaults and Spinning Up's. ``tests/algorithms/test_adam.py`` holds it
against ``torch.optim.Adam(fused=True)`` bit for bit.
"""

from __future__ import annotations

import torch
from torch import Tensor


class FlatAdam:
    """One optimizer over one flat tensor.

    Args:
        values: the parameters, updated in place.
        gradient: where their gradient is found at each step.
        learning_rate: step size.
    """

    def __init__(self, values: Tensor, gradient: Tensor, learning_rate: float) -> None:
        self.learning_rate = learning_rate
        self.first_moment, self.second_moment = torch.zeros_like(values), torch.zeros_like(values)
        self.steps = torch.zeros((), dtype=torch.float32, device=values.device)
        moments = ([self.first_moment], [self.second_moment])
        self._lists: tuple[list[Tensor], ...] = ([values], [gradient], *moments, [], [self.steps])

    def step(self) -> None:
        """One update with the gradient as it stands."""
        self.steps.add_(1)
        torch._fused_adam_(
            *self._lists,
            lr=self.learning_rate,
            beta1=0.9,
            beta2=0.999,
            weight_decay=0.0,
            eps=1e-8,
            amsgrad=False,
            maximize=False,
        )

    def state_dict(self) -> dict[str, Tensor]:
        """Moments and the number of steps."""
        return {name: getattr(self, name).clone() for name in ("first_moment", "second_moment", "steps")}

    def load_state_dict(self, state: dict[str, Tensor]) -> None:
        """Restore what :meth:`state_dict` gave, in place."""
        for name, value in state.items():
            getattr(self, name).copy_(value)
