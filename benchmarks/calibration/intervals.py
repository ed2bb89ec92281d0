"""How often the 95% intervals that the report shows cover the truth, by number of seeds and law."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from analysis import bootstrap
from analysis.hypothesis_tests import t_interval
from benchmarks.calibration.laws import Law
from benchmarks.calibration.rules import contrasts

Array = NDArray[np.float64]
SEEDS = (3, 5, 10)
TASKS = 4
REPETITIONS = 1_000
#: Where an optimality gap is cut, in standard deviations above the mean.
TARGET = 0.5
_POPULATION = 1_000_000


def analytic(law: Law, n: int, simulations: int, seed: int) -> dict[str, float]:
    """Of Welch's intervals: pooled over tasks, and of one task."""
    generator = np.random.default_rng([seed, n, zlib.crc32(law.name.encode())])
    study = contrasts(law.draw(generator, (simulations, 2, TASKS, n)), np.array([[1.0, -1.0]]))
    return {"pooled": float(study.pooled.covers(0.0).mean()), "difference": float(study.tasks.covers(0.0).mean())}


def resampled(law: Law, n: int, simulations: int, seed: int) -> dict[str, float]:
    """Of Student's interval of a mean, and of the report's bootstrap intervals, by the report's own functions."""
    generator = np.random.default_rng([seed, 1, n, zlib.crc32(law.name.encode())])
    population = [law.draw(np.random.default_rng(seed), (_POPULATION,))[None]]
    truth = {name: float(statistic(population)[0]) for name, statistic in _STATISTICS.items()}
    middle = float(np.median(population[0]))
    found: dict[str, list[bool]] = {}
    for _ in range(simulations):
        x, y = law.draw(generator, (2, TASKS, n))
        low, high = t_interval(x[0])
        found.setdefault("mean", []).append(low <= 0 <= high)
        for name, tasks in (("iqm of one task", x[:1]), *((name, x) for name in _STATISTICS)):
            statistic = _STATISTICS["iqm" if name == "iqm of one task" else name]
            low, high = bootstrap.interval(list(tasks), statistic, REPETITIONS)
            found.setdefault(name, []).append(low <= truth["iqm" if name == "iqm of one task" else name] <= high)
        lows, highs = bootstrap.profile_interval(list(x), np.array([middle]), REPETITIONS)
        found.setdefault("profile", []).append(bool(lows[0] <= 0.5 <= highs[0]))
        for name, count in (("improvement on one task", 1), ("improvement", TASKS)):
            low, high = bootstrap.improvement_interval(list(x[:count]), list(y[:count]), REPETITIONS)
            if high > low:  # else none is shown
                found.setdefault(name, []).append(low <= 0.5 <= high)
    return {name: float(np.mean(values)) for name, values in found.items()}


def _gap(tasks: list[Array]) -> Array:
    return bootstrap.optimality_gap(tasks, TARGET)


_STATISTICS: dict[str, Callable[[list[Array]], Array]] = {
    "iqm": bootstrap.iqm,
    "median of tasks": bootstrap.median,
    "mean of tasks": bootstrap.mean,
    "optimality gap": _gap,
}


def coverage(laws: Sequence[Law], simulations: int, resamplings: int, seed: int) -> dict[str, dict[int, list[float]]]:
    """By interval and number of seeds, one share for each law."""
    table: dict[str, dict[int, list[float]]] = {}
    for n in SEEDS:
        for law in laws:
            shares = analytic(law, n, simulations, seed) | resampled(law, n, resamplings, seed)
            for name, share in shares.items():
                table.setdefault(name, {}).setdefault(n, []).append(share)
    return table
