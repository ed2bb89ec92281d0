"""Simulated studies of five actors on some tasks, and what is wrong, or seen, in each of them.

A scenario gives named columns, each one value per study (a share, or true and false); their means are the table.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.calibration.laws import Law
from benchmarks.calibration.rules import Rule, contrasts, judge, judge_by_version_one

Array = NDArray[np.float64]
Columns = dict[str, Any]
Scenario = Callable[[np.random.Generator, int], Columns]
#: Five actors; the first is the one that the claims are about.
ACTORS = 5
#: Points at which actors play, and points of a standard deviation between seeds, where nothing else is said.
LEVEL, SPREAD = 80.0, 20.0
DIFFERENCES = slice(0, 4)
CHUNK = 5_000


def rates(name: str, scenario: Scenario, simulations: int, seed: int) -> dict[str, float]:
    """Means of a scenario's columns over so many studies, from a random stream of its own."""
    generator = np.random.default_rng([seed, zlib.crc32(name.encode())])
    totals: dict[str, float] = {}
    for start in range(0, simulations, CHUNK):
        size = min(CHUNK, simulations - start)
        for column, values in scenario(generator, size).items():
            totals[column] = totals.get(column, 0.0) + float(values.mean()) * size / simulations
    return totals


def draw(generator: np.random.Generator, size: int, law: Law, n: int, tasks: int = 4, spread: float = SPREAD) -> Array:
    """Runs ``[size, actors, tasks, n]`` of actors that are equal in law."""
    return LEVEL + spread * law.draw(generator, (size, ACTORS, tasks, n))


def no_effect(law: Law, n: int) -> Scenario:
    """All actors equal: every answer is wrong. Seeds are planned as they are."""

    def scenario(generator: np.random.Generator, size: int) -> Columns:
        runs = draw(generator, size, law, n)
        judged = judge(runs, Rule(planned_seeds=n))
        return {
            "answers": judged.answered(),
            "every task": (judged.every_task != 0).any(axis=1),
            "version 1": judge_by_version_one(runs).answered(),
        }

    return scenario


def no_effect_by_version_one(law: Law, n: int) -> Scenario:
    """All actors equal, judged by version 1, which took 3 seeds."""

    def scenario(generator: np.random.Generator, size: int) -> Columns:
        return {"version 1": judge_by_version_one(draw(generator, size, law, n)).answered()}

    return scenario


def looks(law: Law) -> Scenario:
    """All actors equal, looked at after each seed up to ten: one wrong answer at any look counts."""

    def scenario(generator: np.random.Generator, size: int) -> Columns:
        runs = draw(generator, size, law, 10)
        now = [judge(runs[..., :n], Rule()).answered() for n in range(5, 11)]
        before = [judge_by_version_one(runs[..., :n]).answered() for n in range(3, 11)]
        return {"answers": np.any(now, axis=0), "version 1": np.any(before, axis=0)}

    return scenario


def two_algorithms(law: Law, n: int) -> Scenario:
    """All actors equal under both algorithms: the answers to the claims under both."""

    def scenario(generator: np.random.Generator, size: int) -> Columns:
        both = [judge(draw(generator, size, law, n), Rule(planned_seeds=n)) for _ in range(2)]
        contradicted = np.any([(judged.claims == -1).any(axis=1) for judged in both], axis=0)
        # supported under each at its own level is more than the rule asks for: an upper bound
        supported = np.all([judged.claims == 1 for judged in both], axis=0).any(axis=1)
        return {"answers": contradicted | supported}

    return scenario


def some_tasks_differ(law: Law, n: int, better_tasks: int, effect: float = 3.0) -> Scenario:
    """The first actor is better by so many standard deviations on the first tasks, equal on the others."""

    def scenario(generator: np.random.Generator, size: int) -> Columns:
        runs = draw(generator, size, law, n)
        runs[:, 0, :better_tasks] += effect * SPREAD
        judged = judge(runs, Rule(planned_seeds=n))
        return {
            "other tasks": (judged.tasks[:, :, better_tasks:] != 0).any(axis=(1, 2)),
            "every task": (judged.every_task != 0).any(axis=1),
            "seen": (judged.claims[:, DIFFERENCES] == 1).mean(axis=1),
        }

    return scenario


def power(law: Law, n: int, effect: float) -> Scenario:
    """The first actor is better by so many standard deviations on every task: what is seen of its four differences."""

    def scenario(generator: np.random.Generator, size: int) -> Columns:
        runs = draw(generator, size, law, n)
        runs[:, 0] += effect * SPREAD
        judged, before = judge(runs, Rule(planned_seeds=n)), judge_by_version_one(runs)
        return {
            "answer": (judged.claims[:, DIFFERENCES] == 1).mean(axis=1),
            "task": (judged.tasks[:, DIFFERENCES] == 1).mean(axis=(1, 2)),
            "every task": (judged.every_task[:, DIFFERENCES] == 1).mean(axis=1),
            "version 1, task": (before.tasks[:, DIFFERENCES] == 1).mean(axis=(1, 2)),
            "version 1, every task": (before.every_task[:, DIFFERENCES] == 1).mean(axis=1),
        }

    return scenario


def relevant_by_a_shift(law: Law, n: int, tasks: int, spread: float) -> Scenario:
    """The first actor is better by exactly the smallest relevant effect: "no relevant difference" is wrong."""

    def scenario(generator: np.random.Generator, size: int) -> Columns:
        runs = draw(generator, size, law, n, tasks, spread)
        runs[:, 0] += Rule().smallest_effect
        return {"equal": judge(runs, Rule(planned_seeds=n)).equal.any(axis=1)}

    return scenario


def relevant_by_failures(n: int, tasks: int, spread: float, others_fail: bool) -> Scenario:
    """Steady actors at 100 points, and others that fail at 0 just often enough for the smallest relevant effect."""

    def scenario(generator: np.random.Generator, size: int) -> Columns:
        runs = 100.0 + spread * generator.standard_normal((size, ACTORS, tasks, n))
        failing = slice(1, ACTORS) if others_fail else slice(0, 1)
        failed = generator.random(runs[:, failing].shape) < Rule().smallest_effect / 100
        runs[:, failing] -= 100.0 * failed
        equal = judge(runs, Rule(planned_seeds=n)).equal[:, DIFFERENCES]
        return {"equal": equal.any(axis=1)}

    return scenario


def equality_seen(n: int, tasks: int, spread: float) -> Scenario:
    """All actors equal, with so many points between seeds: how often that is seen of a difference."""

    def scenario(generator: np.random.Generator, size: int) -> Columns:
        runs = 100.0 + spread * generator.standard_normal((size, ACTORS, tasks, n))
        return {"equal": judge(runs, Rule(planned_seeds=n)).equal[:, DIFFERENCES].mean(axis=1)}

    return scenario


def failures_against_steady(n: int, tasks: int, failures: float = 0.1) -> Scenario:
    """Equal means, unequal shapes: the first actor fails now and then, better in between; the others are steady."""

    def scenario(generator: np.random.Generator, size: int) -> Columns:
        steady = 100.0 * (1 - failures)
        runs = steady + 3.0 * generator.standard_normal((size, ACTORS, tasks, n))
        failed = generator.random((size, tasks, n)) < failures
        runs[:, 0] += np.where(failed, -steady, 100.0 - steady)
        rule = replace(Rule(), planned_seeds=n)
        judged, study = judge(runs, rule), contrasts(runs)
        elsewhere = runs.copy()
        elsewhere[:, 0, 1:] += 100.0  # truly better on all tasks but one: "on every task" is wrong
        return {
            "answer": (judged.claims != 0).any(axis=1),
            "tasks": (judged.tasks != 0).any(axis=(1, 2)),
            "every task": (judge(elsewhere, rule).every_task == 1).any(axis=1),
            "version 1": judge_by_version_one(runs).answered(),
            "covered": study.pooled.covers(0.0)[:, DIFFERENCES].mean(axis=1),
            "covered, task": study.tasks.covers(0.0)[:, DIFFERENCES].mean(axis=(1, 2)),
        }

    return scenario
