"""All parameters of a learner's part in one flat tensor: one Adam call and one Polyak call, and addresses that stay."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import accumulate

import torch
from torch import Tensor, nn

from src.engine.primitives import FLOAT, LINE

_NUMBERS = LINE // FLOAT  # of a cache line


class FlatParameters:
    """Re-points parameters, and their ``grad``, to views of flat tensors for the learner's life.

    Modules keep working as before. Every parameter begins at a cache line; between them lie zeros, whose gradient is
    zero.

    Args:
        parameters: float32 on the CPU, each of its own.
    """

    def __init__(self, parameters: Iterable[nn.Parameter]) -> None:
        self.parameters = list(parameters)
        starts = [0, *accumulate(-(-p.numel() // _NUMBERS) * _NUMBERS for p in self.parameters)]
        self.values, self.gradient = torch.zeros(starts[-1]), torch.zeros(starts[-1])
        for p, start in zip(self.parameters, starts):
            part = slice(start, start + p.numel())
            self.values[part] = p.detach().reshape(-1)
            p.data = self.values[part].view(p.shape)
            p.grad = self.gradient[part].view(p.shape)
        self._addresses = self._find()

    def check(self) -> None:
        """Raise RuntimeError where a parameter no longer lies where it was bound: kernels would write elsewhere."""
        if self._find() != self._addresses:
            raise RuntimeError(
                "a parameter was given other data, or another grad, after the fast engine was bound to it: change "
                "values in place, or train with backend=plain"
            )

    def _find(self) -> list[tuple[int, int]]:
        return [(p.data_ptr(), gradient_address(p)) for p in self.parameters]

    def polyak_update(self, online: FlatParameters, polyak: float) -> None:
        """Polyak averaging of a target network: ``target <- polyak * target + (1 - polyak) * online``."""
        self.values.lerp_(online.values, 1.0 - polyak)


def gradient_address(parameter: Tensor) -> int:
    """Where the gradient of a parameter lies; 0 for none."""
    return 0 if parameter.grad is None else parameter.grad.data_ptr()


class FlatAdam:
    """``torch.optim.Adam(fused=True)`` on one flat tensor, without the bookkeeping around PyTorch's kernel.

        m <- b1 m + (1 - b1) g,   v <- b2 v + (1 - b2) g^2,   x <- x - lr m_hat / (sqrt(v_hat) + eps)

    Betas (0.9, 0.999) and eps 1e-8 are PyTorch's defaults and Spinning Up's. The optimizer's own ``step`` takes 40 us
    more, 5 % of an AAN's update.

    Args:
        flat: parameters, updated in place, and their gradient.
        learning_rate: step size.
    """

    def __init__(self, flat: FlatParameters, learning_rate: float) -> None:
        self.learning_rate = learning_rate
        self.first_moment, self.second_moment = torch.zeros_like(flat.values), torch.zeros_like(flat.values)
        self.steps = torch.zeros((), dtype=torch.float32)
        moments = ([self.first_moment], [self.second_moment])
        self._lists: tuple[list[Tensor], ...] = ([flat.values], [flat.gradient], *moments, [], [self.steps])

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
