"""The bits of two bursts of updates, for every algorithm and actor: ``python -m benchmarks.bits``.

A change of structure must not move a number. Run it before and after, on the same machine with the same BLAS, and
compare the lines; a change that moves them on purpose raises ``ENGINE`` (src/config/schema.py).
"""

from __future__ import annotations

import argparse
import hashlib
from itertools import product

import torch

from benchmarks.configuration import compose
from benchmarks.floor import one_thread
from src.algorithms.build import build_learner
from src.algorithms.learner import Batch, Learner
from src.engine import blas
from src.streams import Streams
from src.training.numerics import set_numerics

OBSERVATION_SIZE = 17
ACTION_SIZE = 6
ACTION_LIMIT = 0.8
BURST = 7  # updates; odd, so that the second burst begins with an update that does not move TD3's actor
BATCH = 100
ACTORS = ("aan", "popsan", "bptsan", "bptsan_wo_ndt", "bptsan_wo_li")
VARIANTS = (
    ("actor.dendritic.bias=branch", "actor.dendritic.branches=3"),
    ("actor.lateral.weights=shared", "actor.lateral.include_self=true"),
    ("actor.dendritic.output_topology=true", "actor.reset_gradient=false"),
    ("encoder.learnable=false", "actor.lateral_gradient=false"),
)


def random_burst(seed: int) -> Batch:
    """Minibatches of normalised observations and uniform actions."""
    generator = torch.Generator().manual_seed(seed)
    shape = (BURST, BATCH)
    return Batch(
        observation=torch.randn(*shape, OBSERVATION_SIZE, generator=generator).clamp(-3, 3),
        action=(torch.rand(*shape, ACTION_SIZE, generator=generator) * 2 - 1) * ACTION_LIMIT,
        reward=torch.randn(*shape, generator=generator),
        next_observation=torch.randn(*shape, OBSERVATION_SIZE, generator=generator).clamp(-3, 3),
        terminated=(torch.rand(*shape, generator=generator) < 0.1).float(),
    )


def digest(learner: Learner, reports: list[dict[str, float]]) -> str:
    """Of everything that two bursts leave: parameters, targets, what they reported, and the next actions."""
    found = hashlib.sha256()
    for name, module in sorted(learner.modules.items()):
        for key, value in sorted(module.state_dict().items()):
            found.update(f"{name}.{key}".encode())
            found.update(value.detach().contiguous().numpy().tobytes())
    for report in reports:
        found.update(repr(sorted((key, f"{value:.5g}") for key, value in report.items())).encode())
    observation = torch.linspace(-3, 3, 10 * OBSERVATION_SIZE).view(10, OBSERVATION_SIZE)
    for action in (learner.explore(observation), learner.act(observation, Streams(1).torch("evaluation"))):
        found.update(action.detach().contiguous().numpy().tobytes())
    return found.hexdigest()[:16]


def line(*overrides: str, algo: str, actor: str, encoder: str) -> str:
    """One configuration and its digest."""
    config = compose(*overrides, algo=algo, env="halfcheetah", actor=actor, encoder=encoder)
    learner = build_learner(config, OBSERVATION_SIZE, ACTION_SIZE, ACTION_LIMIT, Streams(7))
    reports = [learner.learn(random_burst(seed)) for seed in (1, 2)]
    return f"{digest(learner, reports)}  {' '.join((algo, actor, encoder, *overrides))}"


def main() -> None:
    """Print a line for each configuration."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--blas", default="auto", choices=["auto", "mkl", "openblas"])
    arguments = parser.parse_args()
    set_numerics(threads=1)
    print(blas.select(arguments.blas))
    with one_thread():
        for algo, actor in product(("td3", "sac"), ACTORS):
            for encoder in ("task",) if actor == "aan" else ("deterministic", "poisson"):
                print(line(algo=algo, actor=actor, encoder=encoder), flush=True)
        for algo, variant in product(("td3", "sac"), VARIANTS):
            print(line(*variant, algo=algo, actor="bptsan", encoder="poisson"), flush=True)


if __name__ == "__main__":
    main()
