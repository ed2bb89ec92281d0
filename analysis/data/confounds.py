"""Settings outside the actor in which arms of one task differ: such arms are not compared."""

from __future__ import annotations

import json
from typing import Any

import pandas as pd

from analysis.data.flatten import WHO, differing_keys
from analysis.data.names import actor_name
from analysis.data.study import Study

#: What goes with the actor [PopSAN], and where a run ran.
EXEMPT = frozenset({"algo.actor_learning_rate", "algo.log_std_network", "threads", "device"} | WHO)

#: What an arm's name says: the actor, its coding, an option of the algorithm.
_MEANT = ("actor.", "encoder.", "algo.proxy_")


def confounds(study: Study, algo: str, env: str, arms: tuple[str, ...]) -> list[str]:
    """Settings outside the actor in which arms differ ("identical configurations" does not hold), each as a phrase.

    The actor's learning rate and log-std network go with the actor; a key that a label declares as changed is meant.
    """
    runs = study.runs[(study.runs["algo"] == algo) & (study.runs["env"] == env) & study.runs["arm"].isin(arms)]
    configurations = {arm: _configuration(study, runs, algo, env, arm) for arm in arms}
    changed = {key for keys in runs["changed_keys"].unique() for key in json.loads(keys)}
    found: dict[str, str] = {}
    first, first_hashed = configurations[arms[0]]
    for arm in arms[1:]:
        other, other_hashed = configurations[arm]
        for key, old, new in differing_keys(first, other, first_hashed, other_hashed, EXEMPT):
            if not (key.startswith(_MEANT) or key == "algo.name" or key in changed):
                found.setdefault(key, f"{key} ({old} for {actor_name(arms[0])}, {new} for {actor_name(arm)})")
    return [found[key] for key in sorted(found)]


def _configuration(
    study: Study, runs: pd.DataFrame, algo: str, env: str, arm: str
) -> tuple[dict[str, Any], list[str] | None]:
    """An arm's configuration with the engine of its runs, and the keys of both that change numbers."""
    key = f"{algo}/{env}/{arm}"
    engines = str(list(runs.loc[runs["arm"] == arm, "engine"].dropna().unique()))
    hashed = study.hashed_keys.get(key)
    configuration = {**study.configurations.get(key, {}), "engine": engines}
    return configuration, None if hashed is None else [*hashed, "engine"]
