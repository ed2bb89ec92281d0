"""A measured number: the median of several rounds, with the quartiles that tell how far to trust it."""

from __future__ import annotations

import statistics
from collections.abc import Iterable
from typing import NamedTuple


class Spread(NamedTuple):
    """Median and quartiles over the rounds."""

    median: float
    low: float
    high: float
    rounds: int

    @classmethod
    def of(cls, values: Iterable[float]) -> Spread:
        """Of at least one value; the quartiles of one value are the value."""
        found = sorted(values)
        if len(found) == 1:
            return cls(found[0], found[0], found[0], 1)
        low, median, high = statistics.quantiles(found, n=4, method="inclusive")
        return cls(median, low, high, len(found))

    def scaled(self, factor: float) -> Spread:
        """Another unit."""
        return Spread(self.median * factor, self.low * factor, self.high * factor, self.rounds)
