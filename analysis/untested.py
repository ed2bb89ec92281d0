"""Why rows of the claims could not be tested, said once for all of them."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Protocol

from analysis.data.names import actor_name, ordered_arms, ordered_tasks, task_name

#: In the order in which they are told; ``{arms}`` and ``{tasks}`` are lists of names.
REASONS = {
    "task": "no runs on {tasks}",
    "unfinished": "no finished run of {arms} on {tasks}",
    "few": "too few finished seeds of {arms} on {tasks}",
    "settings": "{arms} trained under different settings on {tasks}",
    "variance": "no variance between the seeds of {arms} on {tasks}",
}


class Untested(Protocol):
    """What is read of a row."""

    env: str
    reason: str
    lacking: tuple[str, ...]


def summary(rows: Iterable[Untested]) -> str:
    """The reasons of untested rows, equal ones once: ``no runs on Ant-v4; no finished run of AAN on Hopper-v4``."""
    arms: dict[tuple[str, str], set[str]] = {}
    for row in rows:
        arms.setdefault((row.reason, row.env), set()).update(row.lacking)
    found = []
    for reason, words in REASONS.items():
        groups: dict[tuple[str, ...], list[str]] = {}
        for env in ordered_tasks(env for key, env in arms if key == reason):
            mine = () if reason == "task" else tuple(ordered_arms(arms[reason, env]))
            groups.setdefault(mine, []).append(env)
        found += [
            words.format(arms=", ".join(map(actor_name, mine)), tasks=", ".join(map(task_name, envs)))
            for mine, envs in groups.items()
        ]
    return "; ".join(found)
