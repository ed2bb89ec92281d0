"""Curves for those who watch a run: TensorBoard or Weights & Biases. They never change a number.

A run that is resumed goes on in the series that it began. A kill may leave points behind the checkpoint from which the
run goes on; those points are computed again, and each stands once in the end.
"""

from __future__ import annotations

import secrets
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from src.config.schema import ConfigurationError, ExperimentConfig
from src.config.validation import to_dict
from src.experiment.files import replace_file
from src.experiment.run_directory import RunDirectory

#: In ``state/``: TensorBoard's events; the name under which Weights & Biases knows the run.
EVENTS = "tensorboard"
WANDB_ID = "wandb-id"
_WANDB_NAME_LENGTH = 128  # the most that its server takes


class Logger:
    """Takes points of scalar curves; this one, of ``logger=none``, drops them."""

    def write(self, step: int, values: Mapping[str, float | None]) -> None:
        """Add one point at environment step ``step`` to each curve; None is left out, and so is ``step`` itself."""

    def close(self) -> None:
        """Flush and end."""


class TensorBoard(Logger):
    """Event files in ``state/tensorboard``, one per start of the run; readers see one series.

    Args:
        folder: where the event files lie.
        step: from which the run goes on; 0: from its beginning.
    """

    def __init__(self, folder: Path, step: int) -> None:
        from torch.utils.tensorboard import SummaryWriter

        _wait_for_another_second(folder)
        purge = step + 1 if step > 0 else 0  # readers drop older files' events at this step and later
        self._writer: Any = SummaryWriter(str(folder), purge_step=purge)

    def write(self, step: int, values: Mapping[str, float | None]) -> None:
        """One event per curve, flushed."""
        for name, value in _points(values).items():
            self._writer.add_scalar(name, value, step)
        self._writer.flush()

    def close(self) -> None:
        """Close the event file."""
        self._writer.close()


class WeightsAndBiases(Logger):
    """One run of Weights & Biases for one run directory, over all its resumes.

    It keeps what it knows of a step that it is sent again: the same numbers, since a resume is exact. Offline, each
    start is a folder of its own under ``state/wandb`` with the same id, and nothing can be looked up: ``wandb sync``
    puts them together when it is given all of them in one command.

    Raises:
        ConfigurationError: it is not installed, or it refuses to start (no API key, no network).
    """

    def __init__(self, config: ExperimentConfig, run: RunDirectory) -> None:
        try:
            import wandb
        except ImportError:
            raise ConfigurationError("logger=wandb: wandb is not installed; run: pip install '.[wandb]'") from None
        algo, environment, label, encoder, seed = run.path.parts[-5:]
        try:
            self._run: Any = wandb.init(
                project=config.logger.project,
                mode=config.logger.mode,
                dir=str(run.state),
                id=_wandb_id(run.state),
                resume="allow",
                name=f"{label}-{environment}-{seed}"[-_WANDB_NAME_LENGTH:],
                group="/".join((config.study, algo, environment, label, encoder))[-_WANDB_NAME_LENGTH:],
                config=to_dict(config),
                allow_val_change=True,  # an extended run has other total_steps
            )
        except wandb.Error as error:
            first = str(error).strip().split("\n")[0]
            raise ConfigurationError(
                f"logger=wandb: {first} (logger.mode=offline needs neither key nor network)"
            ) from None

    def write(self, step: int, values: Mapping[str, float | None]) -> None:
        """One row of its history."""
        self._run.log(_points(values), step=step)

    def close(self) -> None:
        """Upload what is left."""
        self._run.finish()


def open_logger(config: ExperimentConfig, run: RunDirectory, step: int) -> Logger:
    """The logger that ``config.logger`` names.

    Args:
        config: the run's configuration.
        run: its run directory.
        step: from which the run goes on; 0: from its beginning.

    Raises:
        ConfigurationError: the logger can't be had.
    """
    if config.logger.name == "tensorboard":
        return TensorBoard(run.state / EVENTS, step)
    if config.logger.name == "wandb":
        return WeightsAndBiases(config, run)
    return Logger()


def _points(values: Mapping[str, float | None]) -> dict[str, float]:
    return {name: value for name, value in values.items() if value is not None and name != "step"}


def _wait_for_another_second(folder: Path) -> None:
    """Readers take event files in the order of their names, which begin with the second in which they were opened."""
    seconds = {path.name.split(".")[3] for path in folder.glob("events.out.tfevents.*")}
    while str(int(time.time())) in seconds:
        time.sleep(0.05)


def _wandb_id(state: Path) -> str:
    """Drawn when the run begins; a run that starts over (``on_conflict=replace``) is another one."""
    path = state / WANDB_ID
    if not path.exists():
        replace_file(path, secrets.token_hex(8).encode())
    return path.read_text()
