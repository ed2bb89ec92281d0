"""How often a shown interval covers the truth, as captions say it."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import yaml

FILE = Path(__file__).with_name("interval_coverage.yaml")


@cache
def intervals() -> dict[str, dict[int, tuple[float, float]]]:
    """Percent, least and most over the simulated laws, by interval and number of seeds."""
    content = yaml.safe_load(FILE.read_text(encoding="utf-8"))
    return {name: {n: (low, high) for n, (low, high) in by_n.items()} for name, by_n in content.items()}


def coverage_words(interval: str, what: str = "the 95% interval") -> str:
    """A sentence for the caption of an interval.

    Raises:
        KeyError: this interval was not calibrated.
    """
    shown = [f"{low}% to {high}% with {n} seeds" for n, (low, high) in intervals()[interval].items()]
    return f"Simulated, {what} covers the truth {', '.join(shown)}."
