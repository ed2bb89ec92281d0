"""Normalised scores: what 0 and 100 mean on a task."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray

from analysis.claims_file import RANDOM, Claims
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


def random_return(env: str, claims: Claims) -> float | None:
    """The mean return of a random policy; None where it has not been measured."""
    if RANDOM in (own := claims.reference_scores.get(env, {})):
        return own[RANDOM]
    found = references()["random_policy"].get(env)
    return None if found is None else float(found["mean"])


def scale(cells: list[Cell], algo: str, env: str, claims: Claims) -> Scale | None:
    """The scale of a task: the claims file's reference, else the committed one, else the mean of the study's own AAN.

    None where no random policy was measured, or neither reference nor a finished AAN above it is there.
    """
    zero = random_return(env, claims)
    if zero is None:
        return None
    committed = references()["aan_reference"].get(algo, {}).get(env)
    hundred = claims.reference_scores.get(env, {}).get(algo, committed)
    if hundred is not None and hundred > zero:
        return Scale(zero, float(hundred))
    own = [cell.final for cell in select(cells, algo, env, REFERENCE_ARM) if cell.n]
    if own and float(own[0].mean()) > zero:
        return Scale(zero, float(own[0].mean()), own=True)
    return None


def normalised(cells: list[Cell], returns: Array, algo: str, env: str, claims: Claims) -> Array:
    """``returns`` on the scale of their task.

    Raises:
        KeyError: the task has none under this algorithm (see :func:`scale`).
    """
    found = scale(cells, algo, env, claims)
    if found is None:
        raise KeyError(f"{algo}/{env}")
    return found.normalised(returns)
