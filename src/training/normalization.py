"""Running normalisation of observations (docs/deviations.md).

Mean and population variance of all raw observations so far, merged block by block in float64 [Chan, Golub and LeVeque,
1979]: for a block of n observations with mean m and sum of squared deviations S, and d = m - mean,

    mean  <- mean + d * n / (count + n)
    sum2  <- sum2 + S + d^2 * count * n / (count + n)
    count <- count + n,          var = sum2 / count

    normalize(o) = clip((o - mean) / sqrt(var + 1.2e-7), -clip, clip)
"""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor

_EPSILON = 1.2e-7


class Normalizer:
    """The running mean and variance, and the map they give. Before the first block: mean 0, variance 1.

    Args:
        size: N, dimensions of the observation.
        clip: the bound of the normalised observation.
        enabled: where False, :meth:`normalize` is the identity and :meth:`update` does nothing.
    """

    def __init__(self, size: int, clip: float, enabled: bool = True) -> None:
        self.size, self.clip, self.enabled = size, clip, enabled
        self.count = 0
        self._mean = torch.zeros(size, dtype=torch.float64)
        self._sum_of_squares = torch.zeros(size, dtype=torch.float64)
        self._cache()

    @property
    def mean(self) -> Tensor:
        """float64 [N]."""
        return self._mean

    @property
    def variance(self) -> Tensor:
        """Population variance, float64 [N]."""
        return self._sum_of_squares / self.count if self.count else torch.ones_like(self._mean)

    def update(self, observations: Tensor) -> None:
        """Merge a block of raw observations [F, N]."""
        if not self.enabled or len(observations) == 0:
            return
        block = observations.detach().to("cpu", torch.float64)
        n = len(block)
        block_mean = block.mean(0)
        difference = block_mean - self._mean
        total = self.count + n
        self._sum_of_squares += (block - block_mean).square_().sum(0) + difference.square() * (self.count * n / total)
        self._mean = self._mean + difference * (n / total)
        self.count = total
        self._cache()

    def normalize(self, observations: Tensor) -> Tensor:
        """float32 [..., N] -> float32 [..., N]: a new tensor, or the same one where disabled."""
        if not self.enabled:
            return observations
        return torch.sub(observations, self._mean32).mul_(self._scale32).clamp_(-self.clip, self.clip)

    def state_dict(self) -> dict[str, Any]:
        """Exact: tensors and an integer."""
        return {"count": self.count, "mean": self._mean.clone(), "sum_of_squares": self._sum_of_squares.clone()}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """The inverse of :meth:`state_dict`.

        Raises:
            ValueError: the state has another size.
        """
        for name in ("mean", "sum_of_squares"):
            if state[name].shape != (self.size,) or state[name].dtype != torch.float64:
                raise ValueError(
                    f"the saved normaliser's {name} has shape {tuple(state[name].shape)}, not ({self.size},)"
                )
        self.count = int(state["count"])
        self._mean = state["mean"].clone()
        self._sum_of_squares = state["sum_of_squares"].clone()
        self._cache()

    def _cache(self) -> None:
        self._mean32 = self._mean.to(torch.float32)
        self._scale32 = (self.variance + _EPSILON).rsqrt().to(torch.float32)
