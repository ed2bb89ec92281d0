"""Names and orders: the paper's actors and tasks as they are printed, and what everything else is called."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from typing import Any

#: The paper's five actors in the order of tables and legends.
ACTORS = {
    "aan": "AAN",
    "popsan": "Regular SAN (PopSAN)",
    "bptsan_wo_ndt": "BPT-SAN w/o NDT",
    "bptsan_wo_li": "BPT-SAN w/o LI",
    "bptsan": "BPT-SAN",
}
#: Actors of other papers, and controls.
OTHER_ACTORS = {
    "aan_matched": "AAN (matched)",
    "popdan": "Pop-DAN",
    "mdcsan": "MDC-SAN",
    "ilcsan": "ILC-SAN",
    "lif_san": "LIF-SAN",
}
TASKS = {
    "hopper": "Hopper-v4",
    "walker2d": "Walker2d-v4",
    "halfcheetah": "HalfCheetah-v4",
    "ant": "Ant-v4 (N=111)",
    "ant_zero_contact": "Ant-v4 (N=111, contacts 0)",
    "ant_no_contact": "Ant-v4 (N=27)",
    "hopper_v5": "Hopper-v5",
    "walker2d_v5": "Walker2d-v5",
    "halfcheetah_v5": "HalfCheetah-v5",
    "ant_v5": "Ant-v5",
    "inverted_double_pendulum": "InvertedDoublePendulum-v4",
    "humanoid": "Humanoid-v4",
}
ALGORITHMS = {"td3": "TD3", "sac": "SAC"}
#: Longer names are shortened where they are printed: a figure has no room for them.
LONGEST = 40


def actor_name(arm: str) -> str:
    """How an arm is printed; one that is of no paper keeps the name of its folder."""
    return ACTORS.get(arm) or OTHER_ACTORS.get(arm) or printable(arm)


def task_name(task: str) -> str:
    """How a task is printed."""
    return TASKS.get(task) or printable(task)


def algorithm_name(algo: str) -> str:
    """How an algorithm is printed."""
    return ALGORITHMS.get(algo) or printable(algo.upper())


def on_one_line(words: str) -> str:
    """Without line breaks and control characters, which others may have put into labels and messages."""
    return "".join(character if character.isprintable() else " " for character in words)


def printable(name: str) -> str:
    """On one line, and no longer than ``LONGEST``: beginning, end and a digest that tells two such names apart."""
    line = on_one_line(name)
    if len(line) <= LONGEST:
        return line
    digest = hashlib.sha256(name.encode("utf-8", "surrogatepass")).hexdigest()[:4]
    return f"{line[:22]}…{line[-10:]} ({digest})"


def ordered(names: Iterable[str], known: Iterable[str]) -> list[str]:
    """Known names in their order, then the others alphabetically."""
    present, order = set(names), list(known)
    return [name for name in order if name in present] + sorted(present - set(order))


def ordered_arms(names: Iterable[str]) -> list[str]:
    """Arms in the order of tables and legends."""
    return ordered(names, ACTORS)


def ordered_tasks(names: Iterable[str]) -> list[str]:
    """Tasks in the paper's order."""
    return ordered(names, TASKS)


def ordered_algorithms(names: Iterable[str]) -> list[str]:
    """TD3, SAC, then others."""
    return ordered(names, ALGORITHMS)


def in_order(cells: Iterable[tuple[Any, ...]]) -> list[tuple[str, str, str]]:
    """Algorithms, tasks and arms in the order of tables, each triple once."""
    present = set(cells)
    if not present:
        return []
    algos, envs, arms = (set(names) for names in zip(*present))
    return [
        (algo, env, arm)
        for algo in ordered_algorithms(algos)
        for env in ordered_tasks(envs)
        for arm in ordered_arms(arms)
        if (algo, env, arm) in present
    ]
