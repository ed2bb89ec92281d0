"""``hydra/launcher=local``: a fresh process per job, one per core (see :mod:`src.experiment.pool`)."""

from __future__ import annotations

from collections.abc import Sequence

from hydra_plugins.testbed.cell_launcher import CellLauncher
from rich.console import Console

from src.config import ConfigurationError
from src.experiment.closing import Ending
from src.experiment.machine import usable_cores
from src.experiment.plan import Cell
from src.experiment.pool import Pool
from src.experiment.sweep_display import SweepDisplay


class LocalLauncher(CellLauncher):
    """See conf/hydra/launcher/local.yaml for the arguments."""

    def __init__(self, n_jobs: int | None, grace_seconds: float, hang_minutes: float | None) -> None:
        self.n_jobs = n_jobs
        self.grace_seconds = grace_seconds
        self.hang_minutes = hang_minutes

    def check(self) -> None:
        """Look at the launcher's keys."""
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
