"""``training.csv``: no number of a comparison depends on it, so damage in it leaves the file out, not the run."""

from __future__ import annotations

import csv
import io
from pathlib import Path

import numpy as np
import pandas as pd

from analysis.data.errors import UnreadableRunError
from analysis.data.files import whole_lines

_MEGABYTES = 64
#: Larger values overflow in means and variances.
_LARGEST = 1e100


def read_training(path: Path, warnings: list[str], early: bool) -> pd.DataFrame:
    """Its rows by step; without rows where the file is missing or damaged, which ``warnings`` then says.

    Args:
        path: the file.
        warnings: what is missing or left out is said here.
        early: the run has not ended its first interval, so there need be no file.
    """
    nothing = pd.DataFrame({"step": np.array([], dtype=np.int64)})
    if early and not path.exists():
        return nothing
    try:
        lines = whole_lines(path, _MEGABYTES, warnings)
        return _numbers(lines) if len(lines) > 1 else nothing
    except UnreadableRunError as error:
        warnings.append(f"{error}; its training data were left out, its evaluations count")
        return nothing


def _numbers(lines: list[str]) -> pd.DataFrame:
    names = lines[0].split(",")
    if "step" not in names or len(set(names)) < len(names):
        raise UnreadableRunError(f"its training.csv begins with {lines[0][:60]!r}: no column step, or one twice")
    frame = pd.read_csv(io.StringIO("\n".join(lines)), float_precision="round_trip", quoting=csv.QUOTE_NONE)
    words = [name for name in frame.columns if frame[name].dtype.kind not in "iuf" and frame[name].notna().any()]
    if words:
        raise UnreadableRunError(f"its training.csv holds something that is no number in column {words[0]}")
    if frame["step"].dtype.kind != "i" or (frame["step"] < 0).any():
        raise UnreadableRunError("its training.csv holds something that is no number of steps in column step")
    for name in frame.columns:
        values = frame[name].to_numpy(dtype=float)
        if (np.isfinite(values) & (np.abs(values) > _LARGEST)).any():
            raise UnreadableRunError(f"its training.csv holds a value above {_LARGEST:g} in column {name}")
    return frame.drop_duplicates("step", keep="last").sort_values("step").reset_index(drop=True)
