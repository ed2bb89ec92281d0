"""Settings outside the actor in which arms of one task differ: such arms are not compared."""

from __future__ import annotations

import json

from analysis.data.flatten import IDENTITY, differing_keys
from analysis.data.names import actor_name
from analysis.data.study import Study, flat_configuration

#: What goes with the actor [PopSAN], and where a run ran.
EXEMPT = frozenset({"algo.actor_learning_rate", "algo.log_std_network", "threads", "device"} | IDENTITY)


def confounds(study: Study, algo: str, env: str, arms: tuple[str, ...]) -> list[str]:
    """Settings outside the actor in which arms differ ("identical configurations" does not hold), each as a phrase.

    The actor's learning rate and log-std network go with the actor; a key that a label declares as changed is meant.
    """
    runs = study.runs[(study.runs["algo"] == algo) & (study.runs["env"] == env) & study.runs["arm"].isin(arms)]
    flat = {arm: flat_configuration(study, algo, env, arm) for arm in arms}
    engines = {arm: str(list(runs.loc[runs["arm"] == arm, "engine"].dropna().unique())) for arm in arms}
    changed = {key for keys in runs["changed_keys"].unique() for key in json.loads(keys)}
    found: dict[str, str] = {}
    for arm in arms[1:]:
        first = {**flat[arms[0]], "engine": engines[arms[0]]}
        for key, old, new in differing_keys(first, {**flat[arm], "engine": engines[arm]}, EXEMPT):
            if not key.startswith(("actor.", "encoder.")) and key not in changed:
                found.setdefault(key, f"{key} ({old} for {actor_name(arms[0])}, {new} for {actor_name(arm)})")
    return [found[key] for key in sorted(found)]
