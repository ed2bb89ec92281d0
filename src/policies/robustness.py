"""``robustness.csv``: a trained policy played under graded disturbances (:mod:`src.policies.disturbances`)."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from gymnasium.wrappers import TransformObservation

from src.actors.build import build_actor
from src.algorithms.networks import DeterministicPolicy
from src.config.schema import ConfigurationError, SpikingActorConfig
from src.experiment.files import replace_file
from src.experiment.run_directory import ROBUSTNESS_FILE
from src.policies import disturbances
from src.policies.disturbances import Disturb
from src.policies.trace import weighted_layers
from src.streams import Streams
from src.training.evaluation import FRESH, Evaluator, Wrap
from src.training.gym_task import make_gym
from src.training.policy_file import TrainedPolicy, load_policy

COLUMNS = ("policy", "disturbance", "severity", "episode", "return", "length")
NONE = "none"
#: BDETT's severity in the middle, half and double beside it; what BDETT does not have follows.
SEVERITIES: dict[str, tuple[float, ...]] = {
    "observation noise": (0.05, 0.1, 0.2),  # standard deviation
    "joint position": (0.05, 0.1, 0.2),  # standard deviation
    "joint velocity": (5.0, 10.0, 20.0),  # standard deviation
    "weight noise": (0.025, 0.05, 0.1),  # standard deviation
    "zeroed synapses": (0.15, 0.3, 0.6),  # share of each layer
    "weight bits": (8.0, 4.0),
    "dead neurons": (0.1, 0.2, 0.4),  # share of each hidden layer
}
#: Disturbances of the weights.
OF_WEIGHTS = {
    "weight noise": disturbances.add_weight_noise,
    "zeroed synapses": disturbances.zero_synapses,
    "weight bits": disturbances.round_weights,
}
TIME_STEPS = "time steps"  # severity: how many more, or fewer, than the policy was trained with


class Condition(NamedTuple):
    """One disturbance at one severity."""

    disturbance: str
    severity: float


class Played(NamedTuple):
    """The episodes under a condition: ``(return, length)`` each."""

    condition: Condition
    episodes: list[tuple[float, int]]


def conditions(trained: TrainedPolicy) -> list[Condition]:
    """The undisturbed policy first, then every disturbance that this actor can have."""
    actor, config = trained.policy.actor, trained.config.actor
    found = [Condition(NONE, 0.0)]
    for disturbance, severities in SEVERITIES.items():
        if disturbance == "dead neurons" and not disturbances.can_be_silenced(actor):
            continue
        if disturbance in OF_WEIGHTS and not weighted_layers(actor):
            continue
        found += [Condition(disturbance, severity) for severity in severities]
    if isinstance(config, SpikingActorConfig):
        trained_with = config.time_steps
        others = sorted({max(1, trained_with // 2), max(1, trained_with - 1), 2 * trained_with} - {trained_with})
        found += [Condition(TIME_STEPS, float(steps - trained_with)) for steps in others]
    return found


def play(path: Path, episodes: int, seed: int) -> Iterator[Played]:
    """Play the policy under every condition, in the episodes of ``python -m src.evaluate RUN --seed SEED``."""
    for condition in conditions(load_policy(path)):
        yield play_condition(path, condition, episodes, seed)


def play_condition(path: Path, condition: Condition, episodes: int, seed: int) -> Played:
    """Play the policy under one condition; at severity 0 this is the plain evaluation.

    Raises:
        ConfigurationError: no such disturbance, or this actor or task can't have it.
    """
    trained = load_policy(path)  # a fresh copy: some conditions change its weights
    wrap = _disturb(trained, condition, Streams(seed)) if condition.severity else None
    evaluator = Evaluator(trained.config.env, episodes, Streams(seed), wrap)
    return Played(condition, evaluator.evaluate(trained.act, FRESH))


def write(folder: Path, policy: str, played: list[Played]) -> Path:
    """Replace ``robustness.csv`` of a run directory."""
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(COLUMNS)
    for (disturbance, severity), episodes in played:
        writer.writerows(
            (policy, disturbance, f"{severity:g}", number, episode_return, length)
            for number, (episode_return, length) in enumerate(episodes)
        )
    path = folder / ROBUSTNESS_FILE
    replace_file(path, buffer.getvalue().encode())
    return path


def _disturb(trained: TrainedPolicy, condition: Condition, streams: Streams) -> Wrap | None:
    """Change the policy, or give the wrapper of its environments. Runs of different seeds draw differently."""
    kind, severity = condition
    draws = Streams(streams.integer("robustness", trained.config.seed))
    if kind in OF_WEIGHTS:
        OF_WEIGHTS[kind](trained.policy.actor, draws, severity)
    elif kind == "dead neurons":
        disturbances.silence_neurons(trained.policy.actor, draws, severity)
    elif kind == TIME_STEPS:
        _change_time_steps(trained, int(severity))
    elif kind == "observation noise":
        return _wrapper(draws, kind, partial(disturbances.noisy, severity=severity))
    elif kind in ("joint position", "joint velocity"):
        with closing(make_gym(trained.config.env)) as environment:
            joints = disturbances.joints_of(environment)
        indices = joints.positions if kind == "joint position" else joints.velocities
        return _wrapper(draws, kind, partial(disturbances.replaced, indices=indices, severity=severity))
    else:
        raise ConfigurationError(f"there is no disturbance {kind!r}")
    return None


def _wrapper(draws: Streams, kind: str, make: Callable[[np.random.Generator], Disturb]) -> Wrap:
    return lambda environment, episode: TransformObservation(environment, make(draws.numpy(kind, episode)), None)


def _change_time_steps(trained: TrainedPolicy, difference: int) -> None:
    """The same weights in an actor of another T."""
    config = trained.config
    if not isinstance(config.actor, SpikingActorConfig):
        raise ConfigurationError(f"{config.actor.name}: has no time steps.")
    changed = replace(config, actor=replace(config.actor, time_steps=config.actor.time_steps + difference))
    weights = trained.policy.actor.state_dict()
    sizes = trained.normalizer.size, len(weights["decoder.bias"])
    actor = build_actor(changed, *sizes, Streams(config.seed))
    actor.load_state_dict(weights)
    trained.policy = DeterministicPolicy(actor.eval(), trained.policy.action_limit)
