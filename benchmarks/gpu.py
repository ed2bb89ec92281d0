"""When a GPU pays: an update there, by PyTorch's autograd, and on one core, by the engine, as the batch grows.

A GPU's time is the launching of its kernels until the batch is large; the paper's 100 is not.
"""

from __future__ import annotations

from collections.abc import Callable

import torch

from benchmarks.configuration import compose
from benchmarks.spread import Spread
from benchmarks.topic import Topic
from benchmarks.update import SIZES, random_burst, seconds
from src.algorithms.build import build_learner
from src.algorithms.learner import Batch
from src.streams import Streams
from src.training.numerics import set_numerics

BATCHES = (100, 1_000, 10_000)
ACTORS = ("aan", "bptsan")
#: Updates in a burst: a few, as one update of the largest batch takes a core the better part of a second.
BURST = 4
ROUNDS = 4


def topic(quick: bool = False) -> Topic:
    """Every batch size; ``quick``: the smallest, bursts of two. No rows where there is no GPU."""
    result = Topic(
        title="update on a GPU",
        method=(
            f"TD3 with Hopper's sizes; bursts of {BURST} updates on the GPU (backend plain) and on one core (backend "
            "fast) in turns; data are where they are computed with. The ratio is the core's time over the GPU's: above "
            "1 the GPU is faster."
        ),
        columns={
            "actor": "actor",
            "batch": "batch",
            "gpu_ms": "GPU ms",
            "cpu_ms": "one core ms",
            "ratio": "ratio",
            "quartiles": "quartiles",
        },
    )
    if not torch.cuda.is_available():
        result.notes.append("PyTorch finds no CUDA GPU here.")
        return result
    for actor in ACTORS:
        for batch in BATCHES[:1] if quick else BATCHES:
            gpu, cpu, ratio = measure(actor, batch, "cuda", 2 if quick else BURST, 1 if quick else ROUNDS)
            result.rows.append({"actor": actor, "batch": batch, "gpu_ms": gpu, "cpu_ms": cpu, "ratio": ratio})
    return result


def measure(actor: str, batch: int, device: str, count: int, rounds: int) -> tuple[Spread, Spread, Spread]:
    """Milliseconds of an update on the device and on one core, and their ratio pair by pair; the first warms up."""
    set_numerics(threads=1)
    burst = random_burst(count, batch, *SIZES["hopper"])
    there, here = (_updates(actor, place, burst) for place in (device, "cpu"))
    pairs = [(seconds(there), seconds(here)) for _ in range(rounds + 1)][1:]
    return (
        Spread.of(gpu for gpu, _ in pairs).scaled(1e3 / count),
        Spread.of(cpu for _, cpu in pairs).scaled(1e3 / count),
        Spread.of(cpu / gpu for gpu, cpu in pairs),
    )


def _updates(actor: str, device: str, burst: Batch) -> Callable[[], None]:
    """The updates of a burst on a device, to its last kernel."""
    _, batch, observation_size = burst.observation.shape
    config = compose(
        f"device={device}",
        f"algo.batch_size={batch}",
        f"protocol.update_after={2 * max(BATCHES)}",  # the largest batch is stored by then
        algo="td3",
        env="hopper",
        actor=actor,
    )
    learner = build_learner(config, observation_size, burst.action.shape[-1], 1.0, Streams(0))
    moved = Batch(*(values.to(device) for values in burst))

    def run() -> None:
        learner.learn(moved)
        if moved.reward.is_cuda:
            torch.cuda.synchronize()

    return run
