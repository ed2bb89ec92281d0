"""Our training loop as it is: a real session over a real run directory, paused between two batches."""

from __future__ import annotations

from contextlib import nullcontext
from unittest.mock import patch

from benchmarks.relay import Turns
from benchmarks.stepwise import StepwiseSpikingActor
from src.config.identity import Run
from src.config.schema import EnvConfig, ExperimentConfig
from src.experiment.ownership import acquire
from src.training.evaluation import Evaluator
from src.training.session import TrainingSession


class Silent:
    """Shows nothing."""

    def update(self, step: int, last_return: float | None, steps_per_second: float) -> None:
        """Nothing."""

    def note(self, text: str) -> None:
        """Nothing."""


def ours(turns: Turns, config: ExperimentConfig, evaluation_env: EnvConfig, reference: bool = False) -> None:
    """A runner; times the parts ``evaluation`` and ``checkpoint``.

    Args:
        turns: where it waits.
        config: the run; its results folder is the caller's to remove.
        evaluation_env: the task of the evaluations, with episodes of a known length.
        reference: the actor as step-by-step eager PyTorch, on the plain backend.
    """
    stepwise = patch("src.actors.build.SpikingActor", StepwiseSpikingActor)
    with acquire(Run(config)) as (run, _), stepwise if reference else nullcontext():
        session = TrainingSession(config, run, Silent())
        session.evaluator = Evaluator(evaluation_env, config.protocol.evaluation_episodes, session.streams)
        session.evaluator.evaluate = turns.timed("evaluation", session.evaluator.evaluate)  # type: ignore[method-assign]
        session.save = turns.timed("checkpoint", session.save)  # type: ignore[method-assign]
        session.loop(lambda: not turns.reached(session.step))
