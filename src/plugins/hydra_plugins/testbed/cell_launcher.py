"""What our launchers have in common: they run planned cells and return how each ended, for the closing table."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence

from hydra.core.utils import JobReturn, JobStatus
from hydra.plugins.launcher import Launcher
from hydra.types import HydraContext, TaskFunction
from omegaconf import DictConfig

from src.experiment.closing import Ending
from src.experiment.compose import cell_of
from src.experiment.plan import Cell, make_plan


class CellLauncher(Launcher):
    """A launcher that takes cells, not command lines."""

    def setup(self, *, hydra_context: HydraContext, task_function: TaskFunction, config: DictConfig) -> None:
        """Hydra's own call."""
        self._config = config
        self._loader = hydra_context.config_loader
        self.check()

    @abstractmethod
    def check(self) -> None:
        """Look at the launcher's keys.

        Raises:
            ConfigurationError: one of them can't be right.
        """

    @abstractmethod
    def jobs_at_once(self, threads: int) -> int:
        """How many jobs of so many threads may run at the same time."""

    @abstractmethod
    def run_cells(self, cells: Sequence[Cell]) -> list[Ending]:
        """Run planned cells."""

    def launch(self, job_overrides: Sequence[Sequence[str]], initial_job_idx: int) -> Sequence[JobReturn]:
        """Hydra's own call, for other sweepers than ours."""
        configs = [cell_of(self._loader.load_sweep_config(self._config, list(each))) for each in job_overrides]
        plan = make_plan(configs)
        endings = {end.name: end for end in self.run_cells(plan.to_do)}
        returns = []
        for overrides, cell in zip(job_overrides, plan.cells):
            end = endings.get(cell.run.name)
            result = JobReturn(overrides=overrides, status=JobStatus.COMPLETED)
            result.return_value = "complete"
            if end is not None and end.state != "complete":
                result.status = JobStatus.FAILED
                result.return_value = RuntimeError(f"{end.name}: {end.state} {end.why}")
            returns.append(result)
        return returns
