"""``hydra/launcher=slurm``: arrays of Slurm jobs through submitit, as Hydra's own submitit launcher does it, but

- a job gets its cell's resolved configuration, not a command line to compose again from a ``conf/`` that may have
  changed while it was waiting;
- what became of a cell is read from its manifest and Slurm's queue: a job that dies without a result is seen, without
  an accounting service, and a failed one is not COMPLETED;
- more cells than one array may have become several;
- cells that wait in the queue already are left there.
"""

from __future__ import annotations

import importlib.util
import shutil
from collections.abc import Sequence
from typing import Any

from hydra_plugins.testbed.cell_launcher import CellLauncher
from omegaconf import OmegaConf
from rich.console import Console

from src.config import ConfigurationError
from src.experiment.closing import Ending
from src.experiment.machine import ROOT
from src.experiment.plan import Cell
from src.experiment.slurm.queue import QueueError, array_limit, job_states
from src.experiment.slurm.submissions import last_jobs
from src.experiment.slurm.submit import Resources, submit
from src.experiment.slurm.watch import Watch, left_in_slurm
from src.experiment.sweep_display import SweepDisplay

_NAMED = 3
_NUMBERS = {  # the smallest value that makes sense
    "timeout_min": 1,
    "max_num_timeout": 0,
    "signal_delay_s": 1,
    "cpus_per_task": 1,
    "array_parallelism": 1,
}


class SlurmLauncher(CellLauncher):
    """See conf/hydra/launcher/slurm.yaml for the arguments."""

    def __init__(self, submitit_folder: str, wait: bool, poll_seconds: float, **resources: Any) -> None:
        self.folder = ROOT / submitit_folder
        self.wait = wait
        self.poll_seconds = poll_seconds
        plain: dict[str, Any] = {
            key: OmegaConf.to_container(value) if OmegaConf.is_config(value) else value
            for key, value in resources.items()
        }
        plain["setup"] = plain.get("setup") or []
        plain["additional_parameters"] = plain.get("additional_parameters") or {}
        unknown = sorted(plain.keys() ^ set(Resources._fields))
        if unknown:
            raise ConfigurationError(
                f"hydra.launcher.{unknown[0]}: there is no such key; more of sbatch's options go into "
                "hydra.launcher.additional_parameters."
            )
        self.resources = Resources(**plain)

    def check(self) -> None:
        """Look at the launcher's keys."""
        for key, least in _NUMBERS.items():
            value = getattr(self.resources, key)
            if value is None and key in ("cpus_per_task", "array_parallelism"):
                continue
            if not isinstance(value, int) or isinstance(value, bool) or value < least:
                raise ConfigurationError(f"hydra.launcher.{key}: should be a number from {least}, found {value!r}.")
        for key, value in (("mem_gb", self.resources.mem_gb), ("poll_seconds", self.poll_seconds)):
            if not isinstance(value, int | float) or isinstance(value, bool) or value <= 0:
                raise ConfigurationError(f"hydra.launcher.{key}: should be a positive number, found {value!r}.")
        if not isinstance(self.resources.setup, list) or not isinstance(self.resources.additional_parameters, dict):
            raise ConfigurationError("hydra.launcher: setup is a list of shell lines, additional_parameters a mapping.")
        if self.resources.signal_delay_s >= 60 * self.resources.timeout_min:
            raise ConfigurationError("hydra.launcher.signal_delay_s: should be less than the time limit, timeout_min.")

    def jobs_at_once(self, threads: int) -> int:
        """``array_parallelism``; without it Slurm decides, and the estimate takes what one array may have."""
        return self.resources.array_parallelism or 1001

    def run_cells(self, cells: Sequence[Cell]) -> list[Ending]:
        """Submit what is not in the queue already, and wait.

        Raises:
            ConfigurationError: nothing was submitted.
        """
        if not cells:
            return []
        _check_machine()
        queued, new = self._split(cells)
        submitted: dict[str, Cell] = {}
        refused: list[tuple[Cell, str]] = []
        if new:
            submitted, refused = submit(new, self._resources_for(new), self.folder, array_limit())
            if not submitted:
                raise ConfigurationError(f"Slurm took no job: {refused[0][1]}")
        with SweepDisplay(Console(), len(cells)) as display:
            for jobs, what in ((submitted, "submitted"), (queued, "in Slurm's queue already")):
                if jobs:
                    display.note(f"{len(jobs)} cells {what}: job {', '.join(_arrays(jobs))}")
            endings = Watch(submitted, self.folder, self.poll_seconds, display).run() if self.wait else []
        endings += [] if self.wait else left_in_slurm(submitted)
        endings += left_in_slurm(queued)
        return endings + [Ending(c.run.name, "not finished", f"not submitted: {why}", c.run.path) for c, why in refused]

    def _split(self, cells: Sequence[Cell]) -> tuple[dict[str, Cell], list[Cell]]:
        """Cells that an earlier command's live jobs are at, by job, and the others."""
        try:
            states = job_states()
        except QueueError as error:
            raise ConfigurationError(f"Slurm doesn't answer: {error}") from None
        queued: dict[str, Cell] = {}
        new: list[Cell] = []
        for cell, job in zip(cells, last_jobs(self.folder, cells)):
            state = states.get(job or "")
            if job is not None and state is not None and not state.over and state.name == cell.config.study:
                queued[job] = cell
            else:
                new.append(cell)
        return queued, new

    def _resources_for(self, cells: Sequence[Cell]) -> Resources:
        threads = max(cell.config.threads for cell in cells)
        cores = self.resources.cpus_per_task or threads
        if cores < threads:
            raise ConfigurationError(f"hydra.launcher.cpus_per_task: {cores} cores can't hold threads={threads}.")
        return self.resources._replace(cpus_per_task=cores)


def _check_machine() -> None:
    if importlib.util.find_spec("submitit") is None:
        raise ConfigurationError("hydra/launcher=slurm needs submitit: pip install '.[slurm]'")
    missing = [name for name in ("sbatch", "srun", "squeue", "scontrol") if shutil.which(name) is None]
    if missing:
        raise ConfigurationError(f"{missing[0]} isn't here: run this command on a login node of a Slurm cluster.")


def _arrays(jobs: dict[str, Cell]) -> list[str]:
    """``12, 13, 14 and 2 more``."""
    arrays = list(dict.fromkeys(job.partition("_")[0] for job in jobs))
    return arrays[:_NAMED] + ([f"and {len(arrays) - _NAMED} more"] if len(arrays) > _NAMED else [])
