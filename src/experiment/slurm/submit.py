"""Cells to arrays of Slurm jobs, through submitit: one array, or as many as the cluster's limit makes necessary.

The arrays don't wait for each other. Where the number of jobs at once is limited, each gets its share of it.
"""

from __future__ import annotations

import os
import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from src.config import to_dict
from src.experiment import threads
from src.experiment.machine import ROOT
from src.experiment.plan import Cell
from src.experiment.slurm.submissions import remember


class Resources(NamedTuple):
    """What a job asks Slurm for; conf/hydra/launcher/slurm.yaml says what each key means."""

    partition: str | None
    account: str | None
    timeout_min: int
    mem_gb: float
    cpus_per_task: int
    array_parallelism: int | None
    max_num_timeout: int
    signal_delay_s: int
    setup: list[str]
    additional_parameters: dict[str, Any]


def submit(
    cells: Sequence[Cell], resources: Resources, folder: Path, array_limit: int
) -> tuple[dict[str, Cell], list[tuple[Cell, str]]]:
    """Submit every cell.

    Returns:
        The cells by job id, and those that Slurm refused with what it said.
    """
    from submitit.core.utils import FailedJobError, FailedSubmissionError
    from submitit.slurm.slurm import SlurmExecutor

    from src.experiment.slurm.task import Task

    folder.mkdir(parents=True, exist_ok=True)
    task = Task(grace_seconds=max(1, resources.signal_delay_s // 2))
    chunks = [cells[start : start + array_limit] for start in range(0, len(cells), array_limit)]
    submitted: dict[str, Cell] = {}
    refused: list[tuple[Cell, str]] = []
    limit = resources.array_parallelism
    for chunk, at_once in zip(chunks, shares(limit, len(chunks)) if limit else map(len, chunks)):
        executor = SlurmExecutor(folder, max_num_timeout=resources.max_num_timeout)
        executor.update_parameters(**parameters(resources, chunk[0].config.study, chunk[0].config.threads, at_once))
        try:
            jobs = executor.map_array(task, [to_dict(cell.config) for cell in chunk])
        except (FailedJobError, FailedSubmissionError) as error:
            refused += [(cell, _what_slurm_says(error)) for cell in chunk]
            continue
        new = {job.job_id: cell for job, cell in zip(jobs, chunk)}
        remember(folder, new)
        submitted |= new
    return submitted, refused


def shares(total: int, parts: int) -> list[int]:
    """``total`` jobs at once over so many arrays, at least one each: ``shares(8, 3) == [3, 3, 2]``."""
    return [max(1, total // parts + (part < total % parts)) for part in range(parts)]


def parameters(resources: Resources, name: str, run_threads: int, at_once: int) -> dict[str, Any]:
    """For ``sbatch``, in submitit's spelling."""
    given = {
        "job_name": name,
        "partition": resources.partition,
        "account": resources.account,
        "time": resources.timeout_min,
        "mem": f"{round(resources.mem_gb * 1024)}MB",
        "cpus_per_task": resources.cpus_per_task,
        "array_parallelism": at_once,
        "signal_delay_s": resources.signal_delay_s,
        "setup": [*_own_setup(run_threads), *resources.setup],
        # srun takes neither from sbatch
        "srun_args": [f"--cpus-per-task={resources.cpus_per_task}", "--open-mode=append"],
        "additional_parameters": {"requeue": True} | resources.additional_parameters,
    }
    return {key: value for key, value in given.items() if value is not None}


def _own_setup(run_threads: int) -> list[str]:
    """A job finds the code and has its threads even where the cluster gives jobs a bare environment."""
    exports = {"PYTHONPATH": os.environ.get("PYTHONPATH", str(ROOT))} | threads.environment(run_threads)
    return [f"cd {shlex.quote(str(ROOT))}"] + [f"export {key}={shlex.quote(value)}" for key, value in exports.items()]


def _what_slurm_says(error: Exception) -> str:
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    told = [line for line in lines if line.startswith("sbatch:")]
    return " ".join(told or lines[-1:])
