"""What one job does: a single run with the live display, or one cell under another launcher of Hydra's."""

from __future__ import annotations

import sys

from hydra.core.hydra_config import HydraConfig
from hydra.types import RunMode
from omegaconf import DictConfig
from rich.console import Console

from src.config import ConfigurationError, ExperimentConfig
from src.experiment.claim import BusyError
from src.experiment.compose import cell_of
from src.experiment.csv_log import last_return
from src.experiment.decision import Action
from src.experiment.execute import RunFailedError, execute
from src.experiment.outcome import FAILED, INTERRUPTED, REFUSED, Outcome
from src.experiment.plan import check_writable, make_plan, show
from src.experiment.progress import PlainProgress, display, number
from src.experiment.run_directory import RunDirectory


def run_composed(composed: DictConfig) -> str:
    """Hydra's task function; returns the run's status.

    Raises:
        SystemExit: of a single run: bad input or a recorded failure (its cause), interrupted or busy.
        ConfigurationError: of one run of many: bad input.
        RunFailedError: of one run of many: it failed and has recorded why.
    """
    if HydraConfig.get().mode != RunMode.RUN:
        return _one_of_many(cell_of(composed))
    try:
        return _alone(cell_of(composed))
    except ConfigurationError as error:
        raise SystemExit(REFUSED) from error  # not an Exception: Hydra would print lines of its own around it
    except RunFailedError as error:
        raise SystemExit(FAILED) from error


def _alone(config: ExperimentConfig) -> str:
    plan = make_plan([config])
    console = Console()
    show(plan, console, 1, with_cost=config.dry_run)
    if config.dry_run:
        return "planned"
    check_writable(config)
    cell = plan.cells[0]
    if cell.decision.action is Action.BUSY:
        sys.exit(INTERRUPTED)
    if not plan.to_do:
        return "complete"
    with display(config.protocol.total_steps) as progress:
        try:
            outcome = execute(config, progress)
        except BusyError as busy:
            progress.note(str(busy))
            sys.exit(INTERRUPTED)
    _tell(outcome, cell.run, console)
    if outcome.status == "interrupted":
        sys.exit(INTERRUPTED)
    return outcome.status


def _tell(outcome: Outcome, run: RunDirectory, console: Console) -> None:
    line = f"{run.name} {outcome.status} at step {outcome.step}"
    line += f", last return {number(last_return(run.path / 'evaluations.csv'))}"
    if outcome.message:
        line += f" ({outcome.message})"
    console.print(f"{line}: {run.path}", highlight=False, markup=False, soft_wrap=True)
    if outcome.status == "interrupted":
        console.print("the same command again goes on from here", highlight=False)


def _one_of_many(config: ExperimentConfig) -> str:
    try:
        outcome = execute(config, PlainProgress(config.protocol.total_steps))
    except BusyError as busy:
        print(busy)
        return "busy"
    if outcome.status == "interrupted":
        raise KeyboardInterrupt  # not an Exception: Hydra's basic launcher then starts no further job
    return outcome.status
