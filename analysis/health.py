"""Spiking health over training: firing rates, surrogate-window share, always-on and never-on neurons per layer.

Spiking actors fail by saturation: the membrane drifts past the threshold, nothing lies inside the surrogate window,
and the
gradient is zero. So the report shows these columns of ``training.csv`` and names the runs that look saturated.
"""

from __future__ import annotations

import re

import numpy as np
import pandas as pd

from analysis.data.names import in_order
from analysis.data.study import KEYS, Study

MEASURES = {
    "firing_rate": "firing rate",
    "window_share": "share inside the surrogate window",
    "always_on": "always-on neurons",
    "never_on": "never-on neurons",
}
#: A layer whose neurons are more often inside the window than this can still learn.
SATURATED_BELOW = 0.02


def layers_of(training: pd.DataFrame) -> list[int]:
    """The spiking layers that ``training.csv`` reports, 1 first; the last is the output population."""
    found = (re.fullmatch(r"layer(\d+)_firing_rate", column) for column in training.columns)
    return sorted(int(match.group(1)) for match in found if match)


def over_training(study: Study, algo: str) -> pd.DataFrame:
    """Mean over all runs of an arm by step, long: ``algo, env, arm, layer, measure, step, value, n``; layer 0 is the
    input.
    """
    training = study.training[study.training["algo"] == algo]
    columns = [(0, "firing_rate", "input_firing_rate")] if "input_firing_rate" in training else []
    columns += [(layer, measure, f"layer{layer}_{measure}") for layer in layers_of(training) for measure in MEASURES]
    parts = []
    for layer, measure, column in columns:
        if column not in training or not training[column].notna().any():
            continue
        grouped = (
            training.dropna(subset=[column]).groupby(["algo", "env", "arm", "step"])[column].agg(["mean", "count"])
        )
        part = grouped.reset_index().rename(columns={"mean": "value", "count": "n"})
        parts.append(part.assign(layer=layer, measure=measure))
    names = ["algo", "env", "arm", "layer", "measure", "step", "value", "n"]
    return pd.concat(parts, ignore_index=True)[names] if parts else pd.DataFrame(columns=names)


def late(study: Study) -> pd.DataFrame:
    """Every numeric column of ``training.csv`` averaged over each counted run's last 10% of steps, one row per run."""
    columns = [column for column in study.training.columns if column not in (*KEYS, "step")]
    if study.training.empty or study.counted.empty:
        return pd.DataFrame(columns=[*KEYS, *columns])
    table = study.training.merge(study.counted[[*KEYS, "training_steps"]], on=KEYS)
    table = table[10 * table["step"] > 9 * table["training_steps"]]
    return table.groupby(KEYS, sort=True)[columns].mean().reset_index()


def final_health(study: Study) -> pd.DataFrame:
    """Per arm and layer, the late means over seeds: ``algo, env, arm, layer, n`` and the measures."""
    runs, rows = late(study), []
    groups = dict(list(runs.groupby(["algo", "env", "arm"], sort=False)))
    for algo, env, arm in in_order(groups):
        group = groups[algo, env, arm]
        for layer in layers_of(study.training):
            values = {
                measure: group.get(f"layer{layer}_{measure}", pd.Series(dtype=float)).mean() for measure in MEASURES
            }
            if not np.isnan(values["firing_rate"]):
                rows.append({"algo": algo, "env": env, "arm": arm, "layer": layer, "n": len(group), **values})
    return pd.DataFrame(rows, columns=["algo", "env", "arm", "layer", "n", *MEASURES])


def saturated(study: Study) -> list[str]:
    """A sentence for each run in which a layer's surrogate window is all but empty at the end of training."""
    runs, sentences = late(study), []
    for _, run in runs.iterrows():
        shares = {layer: run.get(f"layer{layer}_window_share", np.nan) for layer in layers_of(study.training)}
        dead = [f"layer {layer} ({share:.1%})" for layer, share in shares.items() if share < SATURATED_BELOW]
        if dead:
            sentences.append(
                f"{run['algo']}/{run['env']}/{run['arm']}, seed {run['seed']}: almost no neuron lies inside the "
                f"surrogate window "
                f"at the end of training in {', '.join(dead)}: the layer is saturated or silent and passes no gradient."
            )
    return sentences
