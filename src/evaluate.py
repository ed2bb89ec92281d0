"""Play a trained policy again, on fresh episodes: ``python -m src.evaluate RUN --episodes 10``.

It prints the mean return, the standard deviation over episodes and a 95 % t interval of the mean. The episodes differ
from all those of the run's own evaluations. With ``--robustness`` it plays them under graded disturbances and writes
``robustness.csv`` into each run directory; with ``--operations`` it counts instead (docs/policies.md). Relative paths
lie in the repository, whatever the working directory.
"""

from __future__ import annotations

import argparse
import csv
import os
import sys
from collections.abc import Sequence
from pathlib import Path

from src.config.schema import ConfigurationError
from src.paths import repository_path, shown_path
from src.policies import command
from src.policies.command import BEST, policy_path

CONFIDENCE = 0.95


def parse(arguments: Sequence[str] | None = None) -> argparse.Namespace:
    """The command line."""
    parser = command.policy_parser("evaluate", __doc__, runs="+")
    parser.add_argument("--episodes", type=int, default=10, help="episodes to play (default: 10)")
    parser.add_argument(
        "--seed", type=int, default=0, help="seed of the episodes; another one gives others (default: 0)"
    )
    parser.add_argument("--csv", type=repository_path, help="write episode,return,length here too")
    instead = parser.add_mutually_exclusive_group()
    instead.add_argument(
        "--operations",
        action="store_true",
        help="instead: count the final policy's operations over its last evaluation, into RUN/operations.json",
    )
    instead.add_argument("--robustness", action="store_true", help="under graded disturbances, into RUN/robustness.csv")
    options = command.parse(parser, arguments, episodes=1, seed=0)
    for run in options.run:
        if (options.operations or options.robustness) and not run.is_dir():
            parser.error(f"--operations and --robustness: should be given run directories, found {run}")
    if options.csv and len(options.run) > 1:
        parser.error("--csv: takes the episodes of one run")
    if options.operations and options.policy == BEST:
        parser.error("--operations: counts the final policy, not the best one")
    return options


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


def play(path: Path, episodes: int, seed: int) -> tuple[str, list[tuple[float, int]]]:
    """When the policy was kept, and ``(return, length)`` per episode; no evaluation of the run played these."""
    from src.policies import summary
    from src.streams import Streams
    from src.training.evaluation import FRESH, Evaluator
    from src.training.policy_file import load_policy

    trained = load_policy(path)
    evaluator = Evaluator(trained.config.env, episodes, Streams(seed))
    kept = summary.describe(trained.record) if trained.record else "policy of an unknown step"
    return kept, evaluator.evaluate(trained.on_training_backend(), step=FRESH)


def statistics(returns: Sequence[float]) -> str:
    """Mean, standard deviation over episodes (n - 1) and the t interval of the mean; one episode has a mean only."""
    import numpy as np
    from scipy import stats

    mean = float(np.mean(returns))
    if len(returns) < 2:
        return f"mean return {mean:.1f} over 1 episode"
    half = stats.t.ppf((1 + CONFIDENCE) / 2, len(returns) - 1) * stats.sem(returns)
    return (
        f"mean return {mean:.1f} over {len(returns)} episodes, standard deviation {np.std(returns, ddof=1):.1f}, "
        f"{CONFIDENCE:.0%} t interval of the mean {mean - half:.1f} to {mean + half:.1f}"
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """Print a table of the episodes; returns the exit code."""
    options = parse(arguments)

    def work() -> None:
        if options.csv:
            check_csv(options.csv)
        for run in options.run:
            path = policy_path(run, options.policy)
            if options.operations:
                count(run, path)
            elif options.robustness:
                disturb(run, path, options)
            else:
                evaluate(run, path, options)

    return command.run_command(work)


def evaluate(run: Path, path: Path, options: argparse.Namespace) -> None:
    """Play, print the episodes as a table and their statistics, and write the table where one is asked for."""
    from rich.console import Console
    from rich.table import Table

    kept, results = play(path, options.episodes, options.seed)
    table = Table("episode", "return", "length")
    for episode, (episode_return, length) in enumerate(results):
        table.add_row(str(episode), f"{episode_return:.1f}", str(length))
    print(shown_path(run))
    Console().print(table)
    print(kept)
    print(f"{statistics([episode_return for episode_return, _ in results])}, seed {options.seed}")
    if options.csv:
        with options.csv.open("w", newline="") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerows([("episode", "return", "length"), *((i, r, n) for i, (r, n) in enumerate(results))])


def count(run: Path, path: Path) -> None:
    """``--operations``: count, write and say where."""
    from src.policies.operations import count_again, write_operations
    from src.policies.trace import NotTraceable

    try:
        operations = count_again(path)
    except NotTraceable as error:
        raise ConfigurationError(f"{shown_path(run)}: {error}") from None
    written = shown_path(write_operations(run, operations))
    print(f"wrote {written}: {operations.decisions} decisions of {operations.episodes} episodes")


def disturb(run: Path, path: Path, options: argparse.Namespace) -> None:
    """``--robustness``: play under every condition, show each as it is done, write and say where."""
    from src.policies import robustness

    print(f"{shown_path(run)}, {options.policy} policy")
    print(f"{'disturbance':<20}{'severity':>9}{'mean return':>13}{'change':>9}")
    played: list[robustness.Played] = []
    for each in robustness.play(path, options.episodes, options.seed):
        played.append(each)
        plain, mean = (sum(r for r, _ in p.episodes) / options.episodes for p in (played[0], each))
        print(
            f"{each.condition.disturbance:<20}{each.condition.severity:>9g}{mean:>13.1f}{mean - plain:>+9.1f}",
            flush=True,
        )
    print(f"wrote {shown_path(robustness.write(run, options.policy, played))}")


if __name__ == "__main__":
    sys.exit(main())
