"""Hydra's task function: a single run with the live display, or one run under another launcher of Hydra's."""

from __future__ import annotations

import sys

from hydra.core.hydra_config import HydraConfig
from hydra.types import RunMode
from omegaconf import DictConfig
from rich.console import Console

from src.config.compose import compose_run
from src.config.identity import Run
from src.config.schema import ConfigurationError
from src.experiment.display import announced
from src.experiment.files import last_return
from src.experiment.progress import PlainProgress, display, number, say
from src.experiment.run_directory import RunState
from src.experiment.state import ExitCode, Next, Outcome
from src.experiment.worker import RunFailedError, execute


def run_composed(composed: DictConfig) -> str:
    """Train one run and return its state.

    Raises:
        SystemExit: of a single run: bad input or a recorded failure (its cause), interrupted or busy.
        ConfigurationError: of one run of many: bad input.
        RunFailedError: of one run of many: it failed and has recorded why.
    """
    if HydraConfig.get().mode != RunMode.RUN:
        return _one_of_many(compose_run(composed))
    try:
        return _alone(compose_run(composed))
    except ConfigurationError as error:
        raise SystemExit(ExitCode.REFUSED) from error  # not an Exception: Hydra would print lines of its own around it
    except RunFailedError as error:
        raise SystemExit(ExitCode.FAILED) from error


def _alone(run: Run) -> str:
    console = Console()
    plan = announced([run], console, 1, trains_here=True)
    if plan is None:
        return "planned"
    if plan.having(Next.BUSY):
        sys.exit(ExitCode.INTERRUPTED)
    if not plan.to_do:
        return RunState.COMPLETE
    with display(run.config.protocol.total_steps) as progress:
        outcome = execute(run, progress)
    _report(run, outcome, console)
    if outcome.status in (RunState.INTERRUPTED, RunState.BUSY):
        sys.exit(ExitCode.INTERRUPTED)
    return outcome.status


def _report(run: Run, outcome: Outcome, console: Console) -> None:
    if outcome.status == RunState.BUSY:
        say(console, outcome.message)
        return
    line = f"{run.name} {outcome.status} at step {outcome.step}"
    line += f", last return {number(last_return(run.path / 'evaluations.csv'))}"
    if outcome.message:
        line += f" ({outcome.message})"
    say(console, f"{line}: {run.path}")
    if outcome.status == RunState.INTERRUPTED:
        say(console, "the same command again goes on from here")


def _one_of_many(run: Run) -> str:
    if run.config.dry_run:  # under Hydra's own sweepers
        announced([run], Console(), 1)
        return "planned"
    outcome = execute(run, PlainProgress(run.config.protocol.total_steps))
    if outcome.status == RunState.BUSY:
        print(outcome.message)
    if outcome.status == RunState.INTERRUPTED:
        raise KeyboardInterrupt  # not an Exception: Hydra's basic launcher then starts no further job
    return outcome.status
