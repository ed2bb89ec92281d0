"""What disturbances cost a study's trained policies.

Seeds are the unit. What a disturbance costs is the difference to the same run undisturbed, never a ratio to a return
that may be near zero; over seeds the mean difference with a 95 % t interval. Scores are normalised where the task has a
scale, else they are returns.
"""

from __future__ import annotations

import numpy as np
import pandas as pd
from scipy import stats

from analysis.data.robustness import NONE
from analysis.references import Scale

COLUMNS = ["arm", "disturbance", "severity", "n", "score", "change", "change_low", "change_high"]


def summary(runs: pd.DataFrame, scale: Scale | None) -> pd.DataFrame:
    """One row per arm and condition, ``COLUMNS``; an interval needs two seeds.

    Args:
        runs: ``arm, seed, disturbance, severity, return`` of one task under one algorithm, with the plain evaluation
            of every run.
        scale: of the task; None keeps the returns.
    """
    scores = runs.assign(score=runs["return"] if scale is None else scale.normalised(runs["return"].to_numpy(float)))
    plain = scores[scores["disturbance"] == NONE].set_index(["arm", "seed"])["score"]
    scores["change"] = scores["score"] - pd.MultiIndex.from_frame(scores[["arm", "seed"]]).map(plain.to_dict())
    rows = []
    for key, cell in scores.groupby(["arm", "disturbance", "severity"], sort=False):
        n, change = len(cell), float(cell["change"].mean())
        half = float(stats.t.ppf(0.975, n - 1) * stats.sem(cell["change"])) if n > 1 else np.nan
        rows.append([*key, n, float(cell["score"].mean()), change, change - half, change + half])
    return pd.DataFrame(rows, columns=COLUMNS)
