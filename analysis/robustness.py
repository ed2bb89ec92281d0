"""``python -m analysis.robustness results/STUDY``: what disturbances cost, from the ``robustness.csv`` of its runs.

The episodes of a run are averaged first; seeds are the unit. What a disturbance costs is the difference to the same run
undisturbed, never a ratio to a return that may be near zero; over seeds the mean difference with a 95 % t interval.
Scores are normalised (0 a random policy, 100 the published artificial network) where the task's references are known,
else they are returns. Writes ``figures/robustness-<algo>-<task>`` as PDF, PNG and CSV.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from scipy import stats

from analysis.data.errors import InputError
from analysis.data.folders import check_study, run_directories
from analysis.data.writing import read_csv
from analysis.references import references

FILE = "robustness.csv"
NONE = "none"
_COLUMNS = ["policy", "disturbance", "severity", "episode", "return", "length"]
_CELL = ["algo", "env", "arm", "disturbance", "severity"]


def read(study: Path) -> pd.DataFrame:
    """One row per run and condition: ``algo, env, arm, seed, disturbance, severity, score, change, normalised``.

    Raises:
        InputError: no study, no such file in it, or a file that ``docs/run-directory.md`` does not describe.
    """
    check_study(study)
    frames = [
        _of_run(study / "runs" / found.path / FILE, found.path)
        for found in run_directories(study / "runs")
        if not found.wrong and not found.remark and (study / "runs" / found.path / FILE).is_file()
    ]
    if not frames:
        raise InputError(
            f"{study} has no {FILE}: python -m src.evaluate RUN... --robustness writes it into run directories."
        )
    return pd.concat(frames, ignore_index=True)


def _of_run(path: Path, place: str) -> pd.DataFrame:
    algo, env, arm, _, seed = place.split("/")
    table = read_csv(path)
    plain = table[table["disturbance"] == NONE] if list(table.columns) == _COLUMNS else table.head(0)
    if plain.empty or table["return"].isna().any():
        raise InputError(f"{path} is no {FILE} as docs/run-directory.md describes it, with the plain evaluation in it.")
    means = table.groupby(["disturbance", "severity"], sort=False)["return"].mean().reset_index()
    zero, hundred = _scale(algo, env)
    means["score"] = (means.pop("return") - zero) * (100.0 / (hundred - zero) if np.isfinite(hundred) else 1.0)
    means["change"] = means["score"] - float(means.loc[means["disturbance"] == NONE, "score"].iloc[0])
    means["normalised"] = np.isfinite(hundred)
    for position, (name, value) in enumerate(zip(("algo", "env", "arm", "seed"), (algo, env, arm, seed[5:]))):
        means.insert(position, name, value)
    return means


def _scale(algo: str, env: str) -> tuple[float, float]:
    """Returns of a random policy and of the published network; ``(0, inf)`` where one is not known."""
    known = references()
    zero = known["random_policy"].get(env)
    hundred = known["aan_reference"].get(algo, {}).get(env)
    return (0.0, np.inf) if zero is None or hundred is None else (float(zero["mean"]), float(hundred))


def summary(runs: pd.DataFrame) -> pd.DataFrame:
    """One row per arm and condition: mean score and change over n seeds; ``change_low``, ``change_high`` need two."""
    rows = []
    for key, cell in runs.groupby(_CELL, sort=False):
        n, mean = len(cell), float(cell["change"].mean())
        half = float(stats.t.ppf(0.975, n - 1) * stats.sem(cell["change"])) if n > 1 else np.nan
        score = float(cell["score"].mean())
        rows.append([*key, n, score, mean, mean - half, mean + half, bool(cell["normalised"].iloc[0])])
    return pd.DataFrame(rows, columns=[*_CELL, "n", "score", "change", "change_low", "change_high", "normalised"])


def main(arguments: Sequence[str] | None = None) -> int:
    """Draw and write; returns the exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m analysis.robustness", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("study", type=Path, help="results/<study>")
    options = parser.parse_args(arguments)
    from analysis.figures.robustness import draw

    try:
        drawings = draw(summary(read(options.study)))
        folder = options.study / "figures"
        folder.mkdir(exist_ok=True)
        for drawing in drawings:
            drawing.save(folder)
            print(f"{folder / drawing.name}.png: {drawing.alt}")
    except (InputError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
