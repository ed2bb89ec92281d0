"""Whole loops against each other: what they share (protocol, evaluations) and how a window becomes steps per second.

A window is ``WINDOW`` environment steps of the real loop with collection, replay, logging, and one evaluation at its
end. Training, evaluations and checkpoints are timed apart and put together in the proportion of protocol=short: an
evaluation of 10 episodes every 5,000 steps, a checkpoint every 10,000. The length of an episode depends on the
policy, so evaluations are measured on episodes of a fixed length (the task without its early termination), the same
for both sides, and counted as full episodes, the most that a run can have.
"""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import NamedTuple

from benchmarks.configuration import compose
from benchmarks.relay import Window
from benchmarks.spread import Spread
from benchmarks.topic import Row
from src.config.schema import EnvConfig, ExperimentConfig

#: Of protocol=short.
EVALUATION_INTERVAL, CHECKPOINT_INTERVAL = 5_000, 10_000


class Race(NamedTuple):
    """How much is measured: all numbers are environment steps, but for the rounds."""

    warm_up: int  # half of it with random actions and without updates
    window: int
    rounds: int
    episode_length: int  # of the measured evaluations

    def configuration(self, results: Path, **choices: str) -> ExperimentConfig:
        """A run of protocol=short that begins to learn early, evaluates and saves once a window."""
        overrides = {
            "protocol.total_steps": 100_000 // self.window * self.window,
            "protocol.start_steps": self.warm_up // 2,
            "protocol.update_after": self.warm_up // 2,
            "protocol.evaluation_interval": self.window,
            "protocol.checkpoint_interval": self.window,
            "results_dir": str(results),
            "study": "benchmark",
        }
        return compose(*(f"{key}={value}" for key, value in overrides.items()), protocol="short", **choices)

    def evaluation_env(self, task: EnvConfig) -> EnvConfig:
        """Episodes of a known length."""
        kwargs = task.kwargs | {"terminate_when_unhealthy": False}
        return dataclasses.replace(task, kwargs=kwargs, max_episode_steps=self.episode_length)


class Rates(NamedTuple):
    """Environment steps per second of one window, and the seconds of its parts."""

    loop: float  # everything, in the protocol's proportion
    training: float  # no evaluations, no checkpoints
    evaluation: float  # seconds of one evaluation of 10 full episodes


def rates(window: Window, race: Race, full_length: int, part: str = "evaluation") -> Rates:
    """Put a window together; ``part`` is the evaluation that counts where a runner has two."""
    training = window.rest / window.steps
    evaluation = window.parts[part] * full_length / race.episode_length
    checkpoint = window.parts.get("checkpoint", 0.0)
    step = training + evaluation / EVALUATION_INTERVAL + checkpoint / CHECKPOINT_INTERVAL
    return Rates(1 / step, 1 / training, evaluation)


def compared(ours: list[Rates], theirs: list[Rates]) -> Row:
    """One row: the ratios are round by round."""
    pairs = list(zip(ours, theirs, strict=True))
    return {
        "ours": Spread.of(o.loop for o in ours),
        "theirs": Spread.of(t.loop for t in theirs),
        "ratio": Spread.of(o.loop / t.loop for o, t in pairs),
        "training_ratio": Spread.of(o.training / t.training for o, t in pairs),
        "evaluation_ratio": Spread.of(t.evaluation / o.evaluation for o, t in pairs),
        "our_evaluation_seconds": Spread.of(o.evaluation for o in ours),
        "their_evaluation_seconds": Spread.of(t.evaluation for t in theirs),
    }


COLUMNS = {
    "ours": "ours, steps/s",
    "theirs": "theirs",
    "ratio": "ratio",
    "quartiles": "quartiles",
    "goal": "goal",
    "training_ratio": "training alone",
    "evaluation_ratio": "evaluation alone",
}
METHOD = (
    "Environment steps per second of whole loops on Hopper, each in a process of its own on one thread, in turns after "
    "a warm-up ({rounds} rounds of {window} steps): collection, replay, updates, logging, plus 10 evaluation episodes "
    "of 1,000 steps per 5,000 steps (measured on episodes of {episode_length} steps that nothing ends early) and, on "
    "our side, a checkpoint per 10,000. Ratios round by round."
)
