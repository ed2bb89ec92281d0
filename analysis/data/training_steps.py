"""How long the runs of a task are trained, and the steps at which they are evaluated.

The training steps of an algorithm and task are what most of its finished runs of the paper's actors were asked for (of
two equally frequent lengths the longer): one longer or shorter run does not move them.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray


def most_frequent(lengths: list[int]) -> int:
    """The most frequent of ``lengths`` (at least one), the largest of several."""
    counted = Counter(lengths)
    return max(counted, key=lambda steps: (counted[steps], steps))


def due(interval: int, training_steps: int) -> NDArray[np.int64]:
    """The steps at which a run is evaluated: every interval from 0 on, and at the end."""
    return np.unique(np.append(np.arange(0, training_steps + 1, interval, dtype=np.int64), training_steps))


def missing_evaluations(steps: Iterable[int], interval: int, training_steps: int) -> list[str]:
    """Sentences about evaluations that a finished run lacks; those of the last 10% make the final performance.

    Args:
        steps: at which it was evaluated.
        interval: its ``evaluation_interval``.
        training_steps: of its task.
    """
    wanted = due(interval, training_steps)
    have = np.fromiter(steps, dtype=np.int64)
    late = wanted[10 * wanted > 9 * training_steps]
    missing = np.setdiff1d(late, have)
    if len(missing):
        return [
            f"{len(missing)} of the {len(late)} evaluations in the last 10% of its steps are missing "
            f"(step {_shown(missing)}); its final performance is the mean of the others"
        ]
    missing = np.setdiff1d(wanted, have)
    extra = np.setdiff1d(have, wanted)
    found = []
    if len(missing):
        found.append(f"{len(missing)} of its {len(wanted)} evaluations are missing (step {_shown(missing)})")
    if len(extra):
        found.append(f"it was evaluated at {len(extra)} steps at which none is due (step {_shown(extra)})")
    return found


def _shown(steps: NDArray[np.int64]) -> str:
    return ", ".join(f"{step:,}" for step in steps[:3])
