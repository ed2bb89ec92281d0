"""How the time of an update grows with batch, width, time steps, branches and observation size, and how its floor does.

An implementation without hidden loops grows as its matrix products grow: the ratio to the floor stays level or falls.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from benchmarks.configuration import compose
from benchmarks.topic import Row, Topic
from benchmarks.update import SIZES, measure

#: Updates in a burst. The real loop's 50 would take minutes at the largest points; a burst's first update also takes
#: the actor's health, which weighs more in a short one.
BURST = 10
ROUNDS = 3


class Axis(NamedTuple):
    """One quantity that grows while the others stay at the defaults (batch 100, width 256, T 5, d 2, N 11)."""

    name: str
    points: Sequence[int]
    keys: Sequence[str]  # of the configuration; none: the observation size
    actors: Sequence[str]


AXES = (
    Axis("batch", (100, 200, 400, 800, 1600), ("algo.batch_size={0}",), ("bptsan", "aan")),
    Axis(
        "width",
        (128, 256, 512, 1024),
        ("actor.hidden_sizes=[{0},{0}]", "algo.critic_hidden_sizes=[{0},{0}]"),
        ("bptsan", "aan"),
    ),
    Axis("time steps", (1, 2, 4, 8, 16), ("actor.time_steps={0}",), ("bptsan",)),
    Axis("branches", (1, 2, 4, 8), ("actor.dendritic.branches={0}",), ("bptsan",)),
    Axis("observation size", (11, 50, 111, 400), (), ("bptsan", "aan")),
)


def topic(quick: bool = False) -> Topic:
    """Every axis; ``quick``: the two smallest points, bursts of two."""
    result = Topic(
        title="growth",
        method=(
            f"TD3 with Hopper's sizes; one update (bursts of {BURST}, {ROUNDS} rounds) and its bare products in turns "
            "as in the topic update, one quantity growing from the defaults; growth is relative to the axis' first "
            "point."
        ),
        columns={
            "actor": "actor",
            "axis": "axis",
            "value": "value",
            "update_ms": "update ms",
            "floor_ms": "floor ms",
            "growth": "growth",
            "floor_growth": "floor's growth",
            "flop_growth": "FLOP's growth",
            "ratio": "ratio",
            "quartiles": "quartiles",
        },
    )
    for axis in AXES:
        for actor in axis.actors:
            result.rows += _along(axis, actor, quick)
    return result


def _along(axis: Axis, actor: str, quick: bool) -> list[Row]:
    n, m = SIZES["hopper"]
    timings = []
    points = axis.points[:2] if quick else axis.points
    for value in points:
        overrides = [key.format(value) for key in axis.keys]
        config = compose(
            *overrides,
            f"protocol.update_every={2 if quick else BURST}",
            "protocol.update_after=2000",  # the largest batch is stored by then
            algo="td3",
            env="hopper",
            actor=actor,
        )
        sizes = (n, m) if axis.keys else (value, m)
        timings.append(measure(config, sizes, 1 if quick else ROUNDS))
    first = timings[0]
    return [
        {
            "actor": actor,
            "axis": axis.name,
            "value": value,
            "growth": timing.update_ms.median / first.update_ms.median,
            "floor_growth": timing.floor_ms.median / first.floor_ms.median,
            "flop_growth": timing.gflop / first.gflop,
            **timing._asdict(),
        }
        for value, timing in zip(points, timings, strict=True)
    ]
