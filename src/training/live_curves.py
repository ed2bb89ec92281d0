"""Live curves for those who watch a run: TensorBoard or Weights & Biases. They never change a number."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Protocol

from src.config import ConfigurationError, ExperimentConfig, to_dict


class LiveCurves(Protocol):
    """A place for scalar curves."""

    def write(self, step: int, values: dict[str, float | None]) -> None:
        """Add one point to each curve; None is left out."""

    def close(self) -> None:
        """Flush and end."""


class _Nothing:
    def write(self, step: int, values: dict[str, float | None]) -> None:
        """Nowhere."""

    def close(self) -> None:
        """Nothing to end."""


class _TensorBoard:
    def __init__(self, folder: Path, step: int) -> None:
        from torch.utils.tensorboard import SummaryWriter

        self._writer: Any = SummaryWriter(str(folder), purge_step=step or None)

    def write(self, step: int, values: dict[str, float | None]) -> None:
        for name, value in values.items():
            if value is not None:
                self._writer.add_scalar(name, value, step)
        self._writer.flush()

    def close(self) -> None:
        self._writer.close()


class _WeightsAndBiases:
    def __init__(self, config: ExperimentConfig, folder: Path, name: str, step: int) -> None:
        try:
            import wandb
        except ImportError:
            raise ConfigurationError("logger=wandb: wandb is not installed; run: pip install '.[wandb]'") from None
        self._run: Any = wandb.init(
            project=config.logger.project, mode=config.logger.mode, dir=str(folder), name=name, config=to_dict(config)
        )

    def write(self, step: int, values: dict[str, float | None]) -> None:
        self._run.log({k: v for k, v in values.items() if v is not None}, step=step)

    def close(self) -> None:
        self._run.finish()


def open_live_curves(config: ExperimentConfig, state: Path, name: str, step: int) -> LiveCurves:
    """Open the configured logger.

    Args:
        config: ``config.logger`` chooses.
        state: the run's ``state/`` folder.
        name: what the run is called there.
        step: step from which the run goes on (0 for a new one).

    Raises:
        ConfigurationError: the logger's package is not installed.
    """
    if config.logger.name == "tensorboard":
        return _TensorBoard(state / "tensorboard", step)
    if config.logger.name == "wandb":
        return _WeightsAndBiases(config, state, name, step)
    return _Nothing()
