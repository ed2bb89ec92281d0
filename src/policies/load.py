"""A policy file made ready to be played, looked into or exported; nothing else of its run is needed."""

from __future__ import annotations

from pathlib import Path

from src.policies.operations import Operations, count_operations
from src.streams import Streams
from src.training.evaluation import Evaluator
from src.training.numerics import set_numerics
from src.training.policy_file import TrainedPolicy

#: The evaluation step of fresh episodes: no training evaluates there.
FRESH = -1


def load_policy(path: Path) -> TrainedPolicy:
    """Read the file on one thread of the CPU, with the numerics of training.

    Raises:
        CorruptState: the file is not a whole policy file.
    """
    set_numerics(threads=1)
    return TrainedPolicy(path)


def count_again(path: Path) -> Operations:
    """The operations of a final policy over the episodes of its run's last evaluation.

    Raises:
        NotTraceable: see :func:`src.policies.trace.trace`.
    """
    trained = load_policy(path)
    config = trained.config
    step = config.protocol.total_steps if trained.standing is None else trained.standing.step
    evaluator = Evaluator(config, Streams(config.seed))
    return count_operations(trained.policy, trained.normalizer, evaluator, step)
