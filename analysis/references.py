"""Normalised scores: what 0 and 100 mean on a task, and published numbers to set beside ours."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray

from analysis.data.cells import Cell, select

FILE = Path(__file__).with_name("reference_scores.yaml")
Array = NDArray[np.float64]
#: The label whose mean takes the place of a reference that is not known.
REFERENCE_ARM = "aan"


@cache
def references() -> dict[str, Any]:
    """The content of ``reference_scores.yaml``."""
    content: dict[str, Any] = yaml.safe_load(FILE.read_text(encoding="utf-8"))
    return content


@dataclass(frozen=True)
class Scale:
    """``zero``: the return of a random policy; ``hundred``: of the AAN; ``own``: of this study's own AAN."""

    zero: float
    hundred: float
    own: bool = False

    @property
    def points(self) -> float:
        """Normalised points for one unit of return."""
        return 100.0 / (self.hundred - self.zero)

    def normalised(self, returns: Array) -> Array:
        """``100 * (return - zero) / (hundred - zero)``, elementwise."""
        return (np.asarray(returns, dtype=float) - self.zero) * self.points


def random_return(env: str) -> float | None:
    """The mean return of a random policy; None where it has not been measured."""
    found = references()["random_policy"].get(env)
    return None if found is None else float(found["mean"])


def scale(cells: list[Cell], algo: str, env: str) -> Scale | None:
    """The scale of a task: the committed reference, else the mean of the study's own AAN.

    None where no random policy was measured, or neither reference nor a finished AAN above it is there.
    """
    zero = random_return(env)
    if zero is None:
        return None
    hundred = references()["aan_reference"].get(algo, {}).get(env)
    if hundred is not None:
        return Scale(zero, float(hundred))
    own = [cell.final for cell in select(cells, algo, env, REFERENCE_ARM) if cell.n]
    if own and float(own[0].mean()) > zero:
        return Scale(zero, float(own[0].mean()), own=True)
    return None


def normalised(cells: list[Cell], returns: Array, algo: str, env: str) -> Array:
    """``returns`` on the scale of their task.

    Raises:
        KeyError: the task has none under this algorithm (see :func:`scale`).
    """
    found = scale(cells, algo, env)
    if found is None:
        raise KeyError(f"{algo}/{env}")
    return found.normalised(returns)
