"""What the commands on trained policies (evaluate, watch, export) have in common; torch is left to their work."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from src.config.schema import ConfigurationError
from src.experiment import process
from src.experiment.run_directory import BEST_POLICY_FILE, POLICY_FILE
from src.paths import repository_path

FINAL = "final"
BEST = "best"
_NAMES = {FINAL: POLICY_FILE, BEST: BEST_POLICY_FILE}


def policy_parser(command: str, description: str | None, runs: str | None = None) -> argparse.ArgumentParser:
    """A parser of ``python -m src.<command>``: which run (``runs``: argparse's number of them), and which policy."""
    parser = argparse.ArgumentParser(
        prog=f"python -m src.{command}", description=description, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "run", type=repository_path, nargs=runs, metavar="RUN", help="a run directory, or a policy file"
    )
    parser.add_argument(
        "--policy",
        choices=(FINAL, BEST),
        default=FINAL,
        help="of a run directory: its final policy, or that of its best evaluation, which flatters (default: final)",
    )
    return parser


def parse(parser: argparse.ArgumentParser, arguments: Sequence[str] | None, **least: int) -> argparse.Namespace:
    """The command line; of the options named in ``least`` the smallest number allowed."""
    options = parser.parse_args(arguments)
    for name, number in least.items():
        if getattr(options, name) < number:
            parser.error(f"--{name}: should be at least {number}, found {getattr(options, name)}")
    return options


def run_command(work: Callable[[], None]) -> int:
    """Do the work, which loads torch, on one thread; an error is one sentence. Returns the exit code."""
    process.set_threads_before_torch(1)
    try:
        work()
    except (ConfigurationError, RuntimeError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    return 0


def policy_path(run: Path, which: str = FINAL) -> Path:
    """The policy file of a run directory, or the path itself where it is a file.

    Args:
        run: a run directory, or a policy file.
        which: of a run directory: ``final`` or ``best``.

    Raises:
        ConfigurationError: there is none; the message says why that may be.
    """
    if run.is_file():
        return run
    path = run / _NAMES[which]
    if which == FINAL and not path.is_file() and (run / "state" / path.name).is_file():  # of a run of engine 1 or 2
        path = run / "state" / path.name
    if path.is_file():
        return path
    if which == BEST:
        raise ConfigurationError(
            f"{run}: no policy of a best evaluation (policy_best.pt) is there. A run keeps it with keep_best=true, "
            "the default, from its first evaluation on."
        )
    raise ConfigurationError(
        f"{run}: no trained policy (policy.pt) is there. A run leaves it when it completes: train it first, "
        "or name the policy file."
    )
