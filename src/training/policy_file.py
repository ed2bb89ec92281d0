"""The self-contained policy that a finished run leaves: weights, normaliser and configuration in one file."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import torch
from torch import Tensor

from src.actors.build import build_actor
from src.algorithms.build import acting
from src.algorithms.learner import Learner
from src.algorithms.networks import DeterministicPolicy
from src.config.schema import ExperimentConfig
from src.config.validation import to_dict, validate
from src.streams import Streams
from src.training.checkpoint import read_archive, write_archive
from src.training.normalization import Normalizer
from src.training.numerics import set_numerics


class PolicyRecord(NamedTuple):
    """When a policy was kept, and how it did then."""

    step: int
    mean_return: float  # of the evaluation of that step


def save_policy(
    path: Path,
    config: ExperimentConfig,
    learner: Learner,
    normalizer: Normalizer,
    sizes: tuple[int, int],
    record: PolicyRecord,
) -> None:
    """Write the deterministic policy of a run to ``path``; ``sizes`` is (N, M)."""
    write_archive(
        path,
        {
            # a policy is carried away: no path of its machine
            "config": to_dict(replace(config, results_dir="results")),
            "observation_size": sizes[0],
            "action_size": sizes[1],
            "action_limit": learner.policy.action_limit,
            "actor": {k: v.detach().cpu().clone() for k, v in learner.policy.actor.state_dict().items()},
            "normalizer": normalizer.state_dict(),
            "step": record.step,
            "evaluation_return": record.mean_return,
        },
    )


class TrainedPolicy:
    """A policy read back from its file; nothing else of the run is needed.

    Raises:
        CorruptState: the file is not a whole policy file.
    """

    def __init__(self, path: Path) -> None:
        content = read_archive(path)
        self.config = validate(content["config"])
        actor = build_actor(self.config, content["observation_size"], content["action_size"], Streams(self.config.seed))
        actor.load_state_dict(content["actor"])
        self.policy = DeterministicPolicy(actor.eval(), content["action_limit"])
        self.normalizer = Normalizer(
            content["observation_size"], self.config.normalization_clip, self.config.normalize_observations
        )
        self.normalizer.load_state_dict(content["normalizer"])
        #: When it was kept, and its evaluation then; None in the file of an engine before 3.
        self.record: PolicyRecord | None = None
        if "step" in content:
            self.record = PolicyRecord(content["step"], content["evaluation_return"])

    def on_training_backend(self) -> Callable[[Tensor, torch.Generator], Tensor]:
        """:meth:`act` on the backend that trained it, so that an evaluation is replayed bit for bit on one machine."""
        raw = acting(self.config, self.policy.actor)
        return lambda observation, generator: self.policy.squash(raw(self.normalizer.normalize(observation), generator))

    @torch.no_grad()
    def act(self, observation: Tensor, generator: torch.Generator) -> Tensor:
        """Actions ``[B, M]`` for raw observations ``[B, N]``, in plain PyTorch."""
        action: Tensor = self.policy(self.normalizer.normalize(observation), generator)
        return action


def load_policy(path: Path) -> TrainedPolicy:
    """Read the file on one thread of the CPU, with the numerics of training.

    Raises:
        CorruptState: the file is not a whole policy file.
    """
    set_numerics(threads=1)
    return TrainedPolicy(path)
