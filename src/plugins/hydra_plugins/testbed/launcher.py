"""``hydra/launcher=local``: a fresh process per job, one per core (see :mod:`src.experiment.pool`)."""

from __future__ import annotations

from collections.abc import Sequence

from hydra.core.utils import JobReturn, JobStatus
from hydra.plugins.launcher import Launcher
from hydra.types import HydraContext, TaskFunction
from omegaconf import DictConfig
from rich.console import Console

from src.config import ConfigurationError
from src.experiment.closing import Ending
from src.experiment.compose import cell_of
from src.experiment.machine import usable_cores
from src.experiment.plan import Cell, make_plan
from src.experiment.pool import Pool
from src.experiment.sweep_display import SweepDisplay


class LocalLauncher(Launcher):
    """See conf/hydra/launcher/local.yaml for the arguments."""

    def __init__(self, n_jobs: int | None, grace_seconds: float, hang_minutes: float | None) -> None:
        self.n_jobs = n_jobs
        self.grace_seconds = grace_seconds
        self.hang_minutes = hang_minutes

    def setup(self, *, hydra_context: HydraContext, task_function: TaskFunction, config: DictConfig) -> None:
        """Hydra's own call."""
        self._config = config
        self._loader = hydra_context.config_loader
        for key in ("n_jobs", "grace_seconds", "hang_minutes"):
            value = getattr(self, key)
            if value is None and key != "grace_seconds":
                continue
            if not isinstance(value, int if key == "n_jobs" else int | float) or isinstance(value, bool) or value <= 0:
                raise ConfigurationError(f"hydra.launcher.{key}: should be a positive number, found {value!r}.")

    def jobs_at_once(self, threads: int) -> int:
        """``n_jobs``, by default as many as the usable cores hold."""
        return self.n_jobs or max(1, usable_cores() // threads)

    def run_cells(self, cells: Sequence[Cell]) -> list[Ending]:
        """Run planned cells."""
        threads = max((cell.config.threads for cell in cells), default=1)
        with SweepDisplay(Console(), len(cells)) as display:
            return Pool(self.jobs_at_once(threads), self.grace_seconds, self.hang_minutes, display).run(cells)

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
