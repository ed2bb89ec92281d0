"""Play a trained policy again, on fresh episodes: ``python -m src.evaluate RUN --episodes 10``.

Relative paths lie in the repository, whatever the working directory.
"""

from __future__ import annotations

import argparse
import csv
import os
import sys
from dataclasses import replace
from pathlib import Path

from src.config import ConfigurationError
from src.experiment import process
from src.experiment.machine import repository_path


def parse() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(prog="python -m src.evaluate", description=__doc__)
    parser.add_argument("run", type=repository_path, help="a run directory, or its policy.pt")
    parser.add_argument("--episodes", type=int, default=10, help="episodes to play (default: 10)")
    parser.add_argument(
        "--seed", type=int, default=0, help="seed of the episodes; another one gives others (default: 0)"
    )
    parser.add_argument("--csv", type=repository_path, help="write episode,return,length here too")
    arguments = parser.parse_args()
    if arguments.episodes < 1:
        parser.error(f"--episodes: should be at least 1, found {arguments.episodes}")
    if arguments.seed < 0:
        parser.error(f"--seed: should be at least 0, found {arguments.seed}")
    return arguments


def check_csv(path: Path) -> None:
    """Look at the place of the table before episodes are played; nothing is written.

    Raises:
        ConfigurationError: no file can be written there.
    """
    if path.is_dir():
        raise ConfigurationError(f"--csv: {path} is a folder; name a file.")
    if not path.parent.is_dir():
        raise ConfigurationError(f"--csv: there is no folder {path.parent}; make it, or choose another place.")
    if not os.access(path if path.exists() else path.parent, os.W_OK):
        raise ConfigurationError(f"--csv: {path} can't be written; choose another place.")


def policy_path(run: Path) -> Path:
    """The policy file of a run directory, or the path itself where it is a file.

    Raises:
        ConfigurationError: there is none; the message says why that may be.
    """
    path = run if run.is_file() else run / "policy.pt"
    if not path.is_file() and (run / "state" / "policy.pt").is_file():  # of a run of engine 1 or 2
        path = run / "state" / "policy.pt"
    if not path.is_file():
        raise ConfigurationError(
            f"{run}: no trained policy (policy.pt) is there. A run leaves it when it completes: train it first, "
            "or name the policy file."
        )
    return path


def play(path: Path, episodes: int, seed: int) -> list[tuple[float, int]]:
    """``(return, length)`` per episode. The episodes differ from all those of the run's own evaluations."""
    process.set_threads_before_torch(1)
    from src.streams import Streams
    from src.training.evaluation import Evaluator
    from src.training.numerics import set_numerics
    from src.training.policy_file import TrainedPolicy

    set_numerics(threads=1)
    trained = TrainedPolicy(path)
    config = replace(trained.config, protocol=replace(trained.config.protocol, evaluation_episodes=episodes))
    evaluator = Evaluator(config, Streams(seed))
    with trained.policy.actor.fixed_weights():
        return evaluator.evaluate(trained.act, step=-1)


def main() -> int:
    """Print a table of the episodes; returns the exit code."""
    from rich.console import Console
    from rich.table import Table

    arguments = parse()
    try:
        if arguments.csv:
            check_csv(arguments.csv)
        path = policy_path(arguments.run)
        results = play(path, arguments.episodes, arguments.seed)
    except (ConfigurationError, RuntimeError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    table = Table("episode", "return", "length", title=str(arguments.run))
    for episode, (episode_return, length) in enumerate(results):
        table.add_row(str(episode), f"{episode_return:.1f}", str(length))
    Console().print(table)
    mean = sum(r for r, _ in results) / len(results)
    print(f"mean return {mean:.1f} over {len(results)} episodes, seed {arguments.seed}")
    if arguments.csv:
        with arguments.csv.open("w", newline="") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerows([("episode", "return", "length"), *((i, r, n) for i, (r, n) in enumerate(results))])
    return 0


if __name__ == "__main__":
    sys.exit(main())
