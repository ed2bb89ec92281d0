"""What else arms of one task differ in: settings outside the actor, and what goes with it.

Arms with other settings outside the actor are not compared. What goes with an actor (its learning rate, its number of
parameters) is part of the published comparison, and a confound of it: arms are compared, and the report names it.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

import pandas as pd

from analysis.data.flatten import IDENTITY, differing_keys
from analysis.data.names import actor_name
from analysis.data.study import Study, flat_configuration

LEARNING_RATE = "the learning rate"
PARAMETERS = "the number of parameters"
#: Settings that go with the actor [PopSAN], by the name that a claim's ``removes`` calls them.
WITH_THE_ACTOR = {
    "algo.actor_learning_rate": LEARNING_RATE,
    "algo.log_std_network": "the network of the standard deviation",
}
#: Those, and where and by what a run was computed.
EXEMPT = frozenset({*WITH_THE_ACTOR, "backend", "threads", "device"} | IDENTITY)
#: Numbers of parameters that differ by less than this share are matched: lateral weights are 1.6% of BPT-SAN's.
MATCHED = 0.02

#: What an arm's name says: the actor, its coding, an option of the algorithm.
_NAMED_BY_THE_ARM = ("actor.", "encoder.", "algo.proxy_")


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
            if not (key.startswith(_NAMED_BY_THE_ARM) or key == "algo.name" or key in changed):
                found.setdefault(key, f"{key} ({old} for {actor_name(arms[0])}, {new} for {actor_name(arm)})")
    return [found[key] for key in sorted(found)]


@dataclass(frozen=True)
class Confound:
    """What goes with the actor and differs between arms: its name, and ``0.0001 for BPT-SAN, 0.001 for AAN``."""

    name: str
    values: str


def confounds_of_actors(study: Study, algo: str, env: str, arms: tuple[str, ...]) -> tuple[Confound, ...]:
    """What goes with the actors of these arms on a task and is not the same, so that it may make their difference."""
    found = []
    for key, name in WITH_THE_ACTOR.items():
        values = [flat_configuration(study, algo, env, arm).get(key) for arm in arms]
        if len(set(map(str, values))) > 1 and None not in values:
            found.append(Confound(name, _each(arms, [f"{v:g}" if isinstance(v, float) else str(v) for v in values])))
    runs = study.runs[(study.runs["algo"] == algo) & (study.runs["env"] == env)]
    sizes = [runs.loc[runs["arm"] == arm, "actor_parameters"].max() for arm in arms]
    if not any(map(pd.isna, sizes)) and max(sizes) - min(sizes) > MATCHED * max(sizes):
        found.append(Confound(PARAMETERS, _each(arms, [f"{int(size):,}" for size in sizes])))
    return tuple(found)


def _each(arms: tuple[str, ...], values: list[str]) -> str:
    return ", ".join(f"{value} for {actor_name(arm)}" for arm, value in zip(arms, values))


def _configuration(
    study: Study, runs: pd.DataFrame, algo: str, env: str, arm: str
) -> tuple[dict[str, Any], list[str] | None]:
    """An arm's configuration with the engine of its runs, and the keys of both that change numbers."""
    key = f"{algo}/{env}/{arm}"
    engines = str(list(runs.loc[runs["arm"] == arm, "engine"].dropna().unique()))
    hashed = study.hashed_keys.get(key)
    configuration = {**study.configurations.get(key, {}), "engine": engines}
    return configuration, None if hashed is None else [*hashed, "engine"]
