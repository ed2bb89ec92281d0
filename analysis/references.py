"""The committed reference scores: what 0 and 100 mean, and published numbers to set beside ours."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray

FILE = Path(__file__).with_name("reference_scores.yaml")


@cache
def references() -> dict[str, Any]:
    """The content of ``reference_scores.yaml``."""
    content: dict[str, Any] = yaml.safe_load(FILE.read_text(encoding="utf-8"))
    return content


def scale(algo: str, env: str) -> tuple[float, float] | None:
    """``(return that scores 0, return that scores 100)``; None where one of them is not known."""
    zero = references()["random_policy"].get(env)
    hundred = references()["aan_reference"].get(algo, {}).get(env)
    return None if zero is None or hundred is None else (float(zero["mean"]), float(hundred))


def normalised(returns: NDArray[np.float64], algo: str, env: str) -> NDArray[np.float64]:
    """``100 * (return - random) / (reference - random)``, elementwise.

    Raises:
        KeyError: the task has no reference under this algorithm (see :func:`scale`).
    """
    ends = scale(algo, env)
    if ends is None:
        raise KeyError(f"{algo}/{env}")
    return 100.0 * (np.asarray(returns, dtype=float) - ends[0]) / (ends[1] - ends[0])
