"""How often a shown interval covers the truth, as captions say it; from ``python -m benchmarks.calibration``."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import yaml

#: The intervals over tasks.
AGGREGATES = ("iqm", "median of tasks", "mean of tasks", "optimality gap")
FILE = Path(__file__).with_name("interval_coverage.yaml")


@cache
def intervals() -> dict[str, dict[int, tuple[int, int]]]:
    """Percent, least and most over the simulated laws of returns, by interval and number of seeds."""
    content = yaml.safe_load(FILE.read_text(encoding="utf-8"))
    return {name: {n: (low, high) for n, (low, high) in by_n.items()} for name, by_n in content.items()}


def coverage(*names: str) -> str:
    """``83–87 / 90–91 / 92–94% of the time at 3 / 5 / 10 seeds``; of several intervals the least and the most.

    Raises:
        KeyError: such an interval was not calibrated.
    """
    found = [intervals()[name] for name in names]
    ranges = [f"{min(one[n][0] for one in found)}–{max(one[n][1] for one in found)}" for n in found[0]]
    return f"{' / '.join(ranges)}% of the time at {' / '.join(map(str, found[0]))} seeds"


def covers(*names: str) -> str:
    """The sentence for the caption of these intervals."""
    return f"Simulated, such an interval covers the truth {coverage(*names)}."


def few_seeds() -> str:
    """The caveat about all bootstrap intervals."""
    return (
        "With few seeds bootstrap intervals are too narrow: of one task's IQM a nominal 95% interval covers the truth "
        f"{coverage('iqm of one task')}, of the mean over four tasks {coverage('mean of tasks')}."
    )
