"""Runs by the value of a swept key: what the sweep, facet and heat map figures draw."""

from __future__ import annotations

import json
from typing import Any

import pandas as pd

from analysis.data.names import actor_name
from analysis.data.outcome import counts
from analysis.data.schema import Status
from analysis.data.study import KEYS, Study, flat_configuration

COLUMNS = ["env", "line", "arm", "seed", "steps", "value", "final"]


def swept_keys(study: Study, algo: str) -> list[str]:
    """Keys that alone separate variants of an actor."""
    runs = study.runs[study.runs["algo"] == algo]
    alone = (json.loads(keys) for keys in runs["changed_keys"].unique())
    return sorted({next(iter(keys)) for keys in alone if len(keys) == 1})


def runs_by(study: Study, algo: str, keys: tuple[str, ...]) -> pd.DataFrame:
    """One row per complete or diverged run that has the keys, columns ``COLUMNS``; ``value`` is a tuple.

    ``final``: mean of the evaluations in the last 10% of the run's own steps, so that runs of unequal length can stand
    beside one another where ``protocol.total_steps`` is the key. ``line``: the actor with what else was changed.
    """
    runs = study.runs[(study.runs["algo"] == algo) & study.runs["status"].isin([Status.COMPLETE, Status.DIVERGED])]
    if "protocol.total_steps" not in keys:  # as everywhere else, nothing is compared after unequal training
        runs = runs[counts(runs)]
    codings = runs.groupby(["env", "actor"])["encoder"].nunique().to_dict()
    rows: list[dict[str, Any]] = []
    for run in runs.itertuples():
        flat = flat_configuration(study, algo, str(run.env), str(run.arm))
        flat["protocol.total_steps"] = run.total_steps
        value = tuple(_value(flat, key) for key in keys)
        if None in value:
            continue
        changed = json.loads(str(run.changed_keys))
        others = [
            f"{key.removeprefix('actor.')}={flat.get(key, changed[key])}"
            for key in sorted(changed)
            if not _named(key, keys)
        ]
        coding = [str(run.encoder)] if codings[run.env, run.actor] > 1 and "encoder.coding" not in keys else []
        extra = ", ".join([*others, *coding])
        line = actor_name(str(run.actor)) + (f" [{extra}]" if extra else "")
        rows.append(
            {"env": run.env, "line": line, "arm": run.arm, "seed": run.seed, "steps": run.total_steps, "value": value}
        )
    frame = _apart(pd.DataFrame(rows, columns=COLUMNS[:-1]))
    return frame.merge(_finals(study, runs), on=["env", "arm", "seed"]) if rows else pd.DataFrame(columns=COLUMNS)


def _apart(frame: pd.DataFrame) -> pd.DataFrame:
    """Lines that would hold one seed twice at one value are told apart by their arms."""
    twice = frame.duplicated(["env", "line", "value", "seed"], keep=False)
    mixed = set(frame.loc[twice, "line"])
    named = [f"{line} ({arm})" if line in mixed else line for line, arm in zip(frame["line"], frame["arm"])]
    return frame.assign(line=named)


def _finals(study: Study, runs: pd.DataFrame) -> pd.DataFrame:
    table = study.evaluations.merge(runs[[*KEYS, "total_steps"]], on=KEYS)
    late = table[(10 * table["step"] > 9 * table["total_steps"]) & (table["step"] <= table["total_steps"])]
    return late.groupby(["env", "arm", "seed"])["return"].mean().rename("final").reset_index()


def _value(flat: dict[str, Any], key: str) -> Any:
    """The key's value; the key may or may not carry its group's name. None where the configuration lacks it."""
    for name in (key, *(f"{group}.{key}" for group in ("actor", "encoder", "algo", "protocol", "env"))):
        value = flat.get(name)
        if value is not None:
            return str(value) if isinstance(value, (list, dict, bool)) else value
    return None


def _named(changed: str, keys: tuple[str, ...]) -> bool:
    return any(changed == key or changed.endswith(f".{key}") or key.endswith(f".{changed}") for key in keys)


def ordered_values(values: pd.Series) -> list[Any]:
    """Distinct values: numbers by size, else by their words."""
    distinct = list(dict.fromkeys(values))
    numbers = all(isinstance(value, (int, float)) for value in distinct)
    return sorted(distinct) if numbers else sorted(distinct, key=str)
