"""Laws of a run's final performance, in standard deviations about its mean."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Law:
    """Mean 0, standard deviation 1."""

    name: str

    def draw(self, generator: np.random.Generator, shape: tuple[int, ...]) -> Array:
        """Independent runs of this shape."""
        raise NotImplementedError


@dataclass(frozen=True)
class Normal(Law):
    """Gaussian."""

    def draw(self, generator: np.random.Generator, shape: tuple[int, ...]) -> Array:
        """See :class:`Law`."""
        return generator.standard_normal(shape)


@dataclass(frozen=True)
class Lognormal(Law):
    """Skewed to the right: the logarithm has standard deviation 1."""

    def draw(self, generator: np.random.Generator, shape: tuple[int, ...]) -> Array:
        """See :class:`Law`."""
        return np.asarray((np.exp(generator.standard_normal(shape)) - np.exp(0.5)) / np.sqrt((np.e - 1) * np.e))


@dataclass(frozen=True)
class Failing(Law):
    """A share of the runs fails: N(0, 0.05) for these, N(1, 0.1) for the others, before standardising."""

    failures: float
    worked_spread: float = 0.1
    failed_spread: float = 0.05

    @property
    def scale(self) -> float:
        """Standard deviation before standardising."""
        p = self.failures
        return float(np.sqrt(p * (1 - p) + (1 - p) * self.worked_spread**2 + p * self.failed_spread**2))

    def draw(self, generator: np.random.Generator, shape: tuple[int, ...]) -> Array:
        """See :class:`Law`."""
        worked = generator.random(shape) >= self.failures
        spread = np.where(worked, self.worked_spread, self.failed_spread)
        return np.asarray((worked - (1 - self.failures) + spread * generator.standard_normal(shape)) / self.scale)


LAWS: tuple[Law, ...] = (
    Normal("normal"),
    Lognormal("lognormal"),
    Failing("bimodal 70/30", 0.3),
    Failing("bimodal 50/50", 0.5),
)
