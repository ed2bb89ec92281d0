"""Time of one average update over the time of its bare matrix products, measured in turns in one process.

python -m benchmarks.update                    # every actor, TD3 and SAC, Hopper and Ant
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from typing import NamedTuple

import torch

from benchmarks.configuration import compose
from benchmarks.floor import Floor, one_thread, products_of_a_burst
from benchmarks.spread import Spread
from benchmarks.topic import Row, Topic, console
from src.algorithms.build import build_learner
from src.algorithms.learner import Batch
from src.config.schema import ExperimentConfig
from src.streams import Streams
from src.training.numerics import set_numerics

ACTORS = ("aan", "popsan", "bptsan_wo_ndt", "bptsan_wo_li", "bptsan")
SIZES = {"hopper": (11, 3), "ant": (111, 8)}
#: The update may take so many times its products.
GOALS = {"td3": 1.35, "sac": 1.45}
ROUNDS = 4


class Timing(NamedTuple):
    """Milliseconds of one update and of its products, and their ratio, pair by pair."""

    update_ms: Spread
    floor_ms: Spread
    ratio: Spread
    gflop: float
    library: str  # of the floor: the best of the machine


def random_burst(count: int, batch: int, observation_size: int, action_size: int) -> Batch:
    """Normalised observations, actions, rewards: the values matter little to the time."""
    generator = torch.Generator().manual_seed(0)

    def normal(*shape: int) -> torch.Tensor:
        return torch.randn(*shape, generator=generator)

    return Batch(
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


def measure(config: ExperimentConfig, sizes: tuple[int, int], rounds: int) -> Timing:
    """Bursts of ``protocol.update_every`` updates and their floors in turns; the first of each is a warm-up.

    Args:
        config: actor and algorithm.
        sizes: N, M.
        rounds: how many pairs.
    """
    set_numerics(threads=1)
    learner = build_learner(config, *sizes, 1.0, Streams(0))
    count = config.protocol.update_every
    burst = random_burst(count, config.algo.batch_size, *sizes)
    products = Floor(products_of_a_burst(config, *sizes))
    pairs = []
    with one_thread():
        library = products.best_library()
        for _ in range(rounds + 1):
            pairs.append((seconds(lambda: learner.learn(burst)), seconds(lambda: products.run(library))))
    pairs = pairs[1:]
    return Timing(
        update_ms=Spread.of(u for u, _ in pairs).scaled(1e3 / count),
        floor_ms=Spread.of(f for _, f in pairs).scaled(1e3 / count),
        ratio=Spread.of(u / f for u, f in pairs),
        gflop=products.flops / count / 1e9,
        library=library,
    )


def topic(quick: bool = False) -> Topic:
    """Every actor; ``quick``: two actors, bursts of two updates."""
    if quick:
        return _table(("td3",), ("hopper",), ("aan", "bptsan"), 2, "protocol.update_every=2")
    return _table(("td3", "sac"), tuple(SIZES), ACTORS, ROUNDS)


def _table(
    algos: tuple[str, ...], envs: tuple[str, ...], actors: tuple[str, ...], rounds: int, *overrides: str
) -> Topic:
    result = Topic(
        title="update over its products",
        method=(
            "One average update (bursts of 50 on random minibatches of 100) and the bare matrix products of the same "
            "update, forward and backward, by the best BLAS of the machine, in turns in one process on one thread; "
            "ratio pair by pair."
        ),
        columns={
            "algo": "algo",
            "env": "env",
            "actor": "actor",
            "update_ms": "update ms",
            "floor_ms": "floor ms",
            "gflops": "floor GFLOP/s",
            "library": "floor's BLAS",
            "ratio": "ratio",
            "quartiles": "quartiles",
            "goal": "goal",
        },
        goal="at most",
    )
    for algo in algos:
        for env in envs:
            for actor in actors:
                timing = measure(compose(*overrides, algo=algo, env=env, actor=actor), SIZES[env], rounds)
                row: Row = {"algo": algo, "env": env, "actor": actor, "goal": GOALS[algo]}
                gflops = timing.gflop / timing.floor_ms.median * 1e3
                result.rows.append(row | timing._asdict() | {"gflops": gflops})
    return result


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "--rounds", type=int, default=ROUNDS, help="bursts of 50 updates per row (default: %(default)s)"
    )
    parser.add_argument("--algo", nargs="+", default=["td3", "sac"], help="td3 sac")
    parser.add_argument("--env", nargs="+", default=list(SIZES), choices=list(SIZES))
    parser.add_argument("--actor", nargs="+", default=list(ACTORS))
    arguments = parser.parse_args()
    result = _table(tuple(arguments.algo), tuple(arguments.env), tuple(arguments.actor), arguments.rounds)
    console().print(result.table())


if __name__ == "__main__":
    main()
