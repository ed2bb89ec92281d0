"""Time of one average update over the time of its bare matrix products, measured in turns in one process.

python -m benchmarks.update                    # every actor, TD3 and SAC, Hopper and Ant
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Callable
from typing import NamedTuple

import torch
from rich.console import Console
from rich.table import Table

from benchmarks import floor
from benchmarks.configuration import compose
from src.algorithms.build import build_learner
from src.algorithms.learner import Minibatches
from src.streams import Streams
from src.training.numerics import set_numerics

ACTORS = ("aan", "popsan", "bptsan_wo_ndt", "bptsan_wo_li", "bptsan")
SIZES = {"hopper": (11, 3), "ant": (111, 8)}


class Timing(NamedTuple):
    """Milliseconds of one update and of its products (medians), and the median of their ratios, pair by pair."""

    update_ms: float
    floor_ms: float
    ratio: float
    gflop: float


def random_burst(count: int, batch: int, observation_size: int, action_size: int) -> Minibatches:
    """Normalised observations, actions, rewards: the values matter little to the time."""
    generator = torch.Generator().manual_seed(0)

    def normal(*shape: int) -> torch.Tensor:
        return torch.randn(*shape, generator=generator)

    return Minibatches(
        observation=normal(count, batch, observation_size).clamp_(-3, 3),
        action=normal(count, batch, action_size).clamp_(-1, 1),
        reward=normal(count, batch),
        next_observation=normal(count, batch, observation_size).clamp_(-3, 3),
        terminated=(torch.rand(count, batch, generator=generator) < 0.01).float(),
    )


def seconds(call: Callable[[], object]) -> float:
    """Wall time of one call."""
    start = time.perf_counter()
    call()
    return time.perf_counter() - start


def measure(algo: str, env: str, actor: str, rounds: int, *, reference: bool = False) -> Timing:
    """Bursts and floors in turns; the first of each is a warm-up."""
    config = compose(algo=algo, env=env, actor=actor)
    n, m = SIZES[env]
    learner = build_learner(config, n, m, 1.0, Streams(0), reference=reference)
    count = config.protocol.update_every
    burst = random_burst(count, config.algo.batch_size, n, m)
    products = floor.products_of_a_burst(config, n, m)
    pairs = []
    for _ in range(rounds + 1):
        pairs.append((seconds(lambda: learner.update(burst)), seconds(lambda: floor.run(products))))
    pairs = pairs[1:]
    return Timing(
        update_ms=statistics.median(u for u, _ in pairs) / count * 1e3,
        floor_ms=statistics.median(f for _, f in pairs) / count * 1e3,
        ratio=statistics.median(u / f for u, f in pairs),
        gflop=sum(p.flops for p in products) / count / 1e9,
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=7, help="bursts of 50 updates per row (default: 7)")
    parser.add_argument("--algo", nargs="+", default=["td3", "sac"], help="td3 sac")
    parser.add_argument("--env", nargs="+", default=list(SIZES), choices=list(SIZES))
    parser.add_argument("--actor", nargs="+", default=list(ACTORS))
    arguments = parser.parse_args()
    set_numerics(threads=1)
    table = Table("algo", "env", "actor", "update ms", "floor ms", "ratio", "GFLOP", title="update over its products")
    for algo in arguments.algo:
        for env in arguments.env:
            for actor in arguments.actor:
                t = measure(algo, env, actor, arguments.rounds)
                table.add_row(
                    algo, env, actor, f"{t.update_ms:.2f}", f"{t.floor_ms:.2f}", f"{t.ratio:.2f}", f"{t.gflop:.2f}"
                )
    Console().print(table)


if __name__ == "__main__":
    main()
