"""``robustness.csv`` of a run: the returns of its trained policy under graded disturbances (docs/run-directory.md)."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pandas as pd

from analysis.data.errors import UnreadableRunError
from analysis.data.files import read_text

NONE = "none"  # the plain evaluation
COLUMNS = ["disturbance", "severity", "return"]
_MEGABYTES = 4
_FILE = ["policy", "disturbance", "severity", "episode", "return", "length"]


def read_robustness(path: Path, warnings: list[str]) -> pd.DataFrame:
    """One row per condition, ``COLUMNS``, its episodes averaged; empty where there is no file.

    A damaged file is left out with a warning: no other number depends on it.
    """
    nothing = pd.DataFrame(columns=COLUMNS)
    try:
        table = pd.read_csv(
            io.StringIO(read_text(path, _MEGABYTES)), float_precision="round_trip", keep_default_na=False
        )
        if list(table.columns) != _FILE:
            raise ValueError(f"its columns are {', '.join(map(str, table.columns))}")
        numbers = table[["severity", "return"]].apply(pd.to_numeric)
        if not np.isfinite(numbers.to_numpy(float)).all():
            raise ValueError("a severity or a return is no finite number")
        if NONE not in set(table["disturbance"]):
            raise ValueError("the plain evaluation is not in it")
    except FileNotFoundError:
        return nothing
    except (UnreadableRunError, ValueError) as error:
        warnings.append(f"its robustness.csv is damaged ({error}); it was left out")
        return nothing
    table[["severity", "return"]] = numbers
    return table.groupby(["disturbance", "severity"], sort=False)["return"].mean().reset_index()[COLUMNS]
