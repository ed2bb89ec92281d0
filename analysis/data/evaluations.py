"""``evaluations.csv``: one row per episode, averaged to one row per evaluation; what could move a number is refused."""

from __future__ import annotations

import csv
import io
from pathlib import Path

import numpy as np
import pandas as pd

from analysis.data.errors import UnreadableRunError
from analysis.data.files import whole_lines

COLUMNS = ["step", "episode", "return", "length"]
#: No task gives larger returns, and float64 adds nothing of an ordinary one to them.
LARGEST_RETURN = 1e15
_MEGABYTES = 64


def read_evaluations(path: Path, episodes: int, total_steps: int, warnings: list[str]) -> pd.DataFrame:
    """One row per evaluation: ``step, return, length`` (means over its episodes), sorted; NaN or infinity propagates.

    Args:
        path: the file.
        episodes: how many the configuration asks for. An evaluation with fewer was cut off by a kill: left out.
        total_steps: how many the run was asked for.
        warnings: what is left out is said here.

    Raises:
        UnreadableRunError: the file is damaged in a way that could move a number.
    """
    lines = whole_lines(path, _MEGABYTES, warnings)
    if lines and lines[0].split(",") != COLUMNS:
        raise UnreadableRunError(f"its evaluations.csv begins with {lines[0][:60]!r}, not {','.join(COLUMNS)}")
    if len(lines) < 2:
        return pd.DataFrame({"step": np.array([], dtype=np.int64), "return": [], "length": []})
    rows = _without_repeated(_numbers(lines), warnings)
    _refuse_impossible(rows, episodes, total_steps)
    rows = rows.sort_values(["step", "episode"])
    steps, starts, counts = np.unique(rows["step"].to_numpy(), return_index=True, return_counts=True)
    table = pd.DataFrame({"step": steps})
    for column in ("return", "length"):  # reduceat propagates NaN, where groupby.mean would skip it
        table[column] = np.add.reduceat(rows[column].to_numpy(dtype=float), starts) / counts
    partial = counts < episodes
    if partial.any():
        where = ", ".join(f"{step:,}" for step in steps[partial][:3])
        warnings.append(
            f"{int(partial.sum())} evaluation(s) with fewer than {episodes} episodes were left out (step {where})"
        )
    return table[~partial].reset_index(drop=True)


def _numbers(lines: list[str]) -> pd.DataFrame:
    for number, line in enumerate(lines, start=1):
        if not all(map(str.strip, line.split(","))):
            raise UnreadableRunError(f"line {number} of its evaluations.csv has an empty field")
    # "nan" is a return that is no number: the run diverged; any other word is damage
    rows = pd.read_csv(
        io.StringIO("\n".join(lines)),
        float_precision="round_trip",
        keep_default_na=False,
        na_values={"return": ["nan", "-nan", "NaN"]},
        quoting=csv.QUOTE_NONE,
    )
    for column in COLUMNS:
        whole = column != "return"
        if rows[column].dtype.kind not in ("iu" if whole else "iuf"):
            kind = "whole number" if whole else "number"
            raise UnreadableRunError(f"its evaluations.csv holds something that is no {kind} in column {column}")
    return rows


def _without_repeated(rows: pd.DataFrame, warnings: list[str]) -> pd.DataFrame:
    if not rows.duplicated(["step", "episode"]).any():
        return rows
    once = rows.drop_duplicates(COLUMNS)
    twice = once[once.duplicated(["step", "episode"])]
    if len(twice):
        raise UnreadableRunError(
            f"its evaluations.csv has an episode of step {int(twice['step'].iloc[0]):,} twice, with different returns"
        )
    warnings.append(f"{len(rows) - len(once)} repeated row(s) of evaluations.csv were left out")
    return once


def _refuse_impossible(rows: pd.DataFrame, episodes: int, total_steps: int) -> None:
    """Rows that the run's own configuration rules out: then one of the two files is not this run's."""
    rules = (
        ((rows["step"] < 0) | (rows["step"] > total_steps), "step", f"steps go from 0 to {total_steps:,}"),
        (
            (rows["episode"] < 0) | (rows["episode"] >= episodes),
            "episode",
            f"its configuration says {episodes} episodes, 0 to {episodes - 1}",
        ),
        (rows["length"] < 1, "length", "an episode has at least one step"),
        (
            np.isfinite(rows["return"]) & (rows["return"].abs() > LARGEST_RETURN),
            "return",
            f"no task gives more than {LARGEST_RETURN:g}",
        ),
    )
    for wrong, column, right in rules:
        if wrong.any():
            first = int(np.flatnonzero(wrong)[0])
            where = "" if column == "step" else f" at step {rows['step'].iloc[first]:,}"
            raise UnreadableRunError(f"its evaluations.csv has {column} {rows[column].iloc[first]:,}{where}; {right}")
