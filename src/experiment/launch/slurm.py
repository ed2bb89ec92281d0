"""``hydra/launcher=slurm``: arrays of Slurm jobs through submitit, as Hydra's own submitit launcher does it, but

- a job gets its run's resolved configuration, not a command line to compose again from a ``conf/`` that may have
  changed while it was waiting;
- what became of a run is read from its manifest and Slurm's queue: a job that dies without a result is seen, without
  an accounting service, and a failed one is not COMPLETED;
- more runs than one array may have become several arrays, which don't wait for each other;
- runs that wait in the queue already are left there.

Ctrl-C, or the death of this process, ends the watching only: the jobs go on.
"""

from __future__ import annotations

import importlib.util
import os
import shlex
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator
from rich.console import Console

from src.config.identity import Run
from src.config.schema import ConfigurationError, Positive, PositiveFloat
from src.experiment.display import SweepDisplay
from src.experiment.launch.slurm_queue import (
    DEFAULT_ARRAY_LIMIT,
    QueueError,
    Watch,
    array_ids,
    array_limit,
    job_states,
    last_jobs,
    left_in_slurm,
    remember_jobs,
)
from src.experiment.process import thread_environment
from src.experiment.run_directory import RunState
from src.experiment.state import RunResult
from src.paths import ROOT, repository_path

Jobs = dict[str, Run]


class SlurmSettings(BaseModel):
    """The keys of conf/hydra/launcher/slurm.yaml, which says what each means."""

    model_config = ConfigDict(extra="forbid", strict=True)

    partition: str | None
    account: str | None
    timeout_min: Positive
    max_num_timeout: Annotated[int, Field(ge=0)]
    signal_delay_s: Positive
    mem_gb: PositiveFloat
    cpus_per_task: Positive | None
    array_parallelism: Positive | None
    setup: list[str] | None
    additional_parameters: dict[str, Any] | None
    wait: bool
    poll_seconds: PositiveFloat
    submitit_folder: str

    @model_validator(mode="after")
    def _signal_within_the_time_limit(self) -> Self:
        if self.signal_delay_s >= 60 * self.timeout_min:
            raise ValueError("hydra.launcher.signal_delay_s: should be less than the time limit, timeout_min.")
        return self

    @property
    def folder(self) -> Path:
        """Where submission files and the jobs' output lie."""
        return repository_path(self.submitit_folder)

    def jobs_at_once(self, _threads: int) -> int:
        """``array_parallelism``; without it Slurm decides, and the estimate takes what one array may have."""
        return self.array_parallelism or DEFAULT_ARRAY_LIMIT


def run_in_slurm(settings: SlurmSettings, runs: Sequence[Run]) -> list[RunResult]:
    """Submit what is not in the queue already, and wait.

    Raises:
        ConfigurationError: nothing was submitted.
    """
    if not runs:
        return []
    _check_machine()
    queued, new = _split(settings, runs)
    submitted: Jobs = {}
    refused: list[tuple[Run, str]] = []
    if new:
        submitted, refused = submit(new, settings)
        if not submitted:
            raise ConfigurationError(f"Slurm took no job: {refused[0][1]}")
    with SweepDisplay(Console(), len(runs)) as display:
        for jobs, what in ((submitted, "submitted"), (queued, "in Slurm's queue already")):
            if jobs:
                display.note(f"{len(jobs)} runs {what}: job {', '.join(array_ids(jobs))}")
        if settings.wait:
            results = Watch(submitted, settings.folder, settings.poll_seconds, display).run()
        else:
            results = left_in_slurm(submitted)
    results += left_in_slurm(queued)
    return results + [RunResult(run, RunState.NOT_FINISHED, f"not submitted: {why}") for run, why in refused]


def _check_machine() -> None:
    if importlib.util.find_spec("submitit") is None:
        raise ConfigurationError("hydra/launcher=slurm needs submitit: pip install '.[slurm]'")
    missing = [name for name in ("sbatch", "srun", "squeue", "scontrol") if shutil.which(name) is None]
    if missing:
        raise ConfigurationError(f"{missing[0]} isn't here: run this command on a login node of a Slurm cluster.")


def _split(settings: SlurmSettings, runs: Sequence[Run]) -> tuple[Jobs, list[Run]]:
    """Runs that an earlier command's live jobs are at, by job, and the others."""
    try:
        states = job_states()
    except QueueError as error:
        raise ConfigurationError(f"Slurm doesn't answer: {error}") from None
    queued: Jobs = {}
    new: list[Run] = []
    for run, job in zip(runs, last_jobs(settings.folder, runs)):
        state = states.get(job or "")
        if job is not None and state is not None and not state.over and state.name == run.config.study:
            queued[job] = run
        else:
            new.append(run)
    return queued, new


def submit(runs: Sequence[Run], settings: SlurmSettings) -> tuple[Jobs, list[tuple[Run, str]]]:
    """Submit every run.

    Returns:
        The runs by job id, and those that Slurm refused with what it said.
    """
    from submitit.core.utils import FailedJobError, FailedSubmissionError
    from submitit.slurm.slurm import SlurmExecutor

    from src.experiment.launch.slurm_job import Task

    folder = settings.folder
    folder.mkdir(parents=True, exist_ok=True)
    settings = _with_cores(settings, runs)
    task = Task(grace_seconds=max(1, settings.signal_delay_s // 2))
    size = array_limit()
    chunks = [runs[start : start + size] for start in range(0, len(runs), size)]
    limit = settings.array_parallelism
    submitted: Jobs = {}
    refused: list[tuple[Run, str]] = []
    for chunk, at_once in zip(chunks, shares(limit, len(chunks)) if limit else map(len, chunks)):
        executor = SlurmExecutor(folder, max_num_timeout=settings.max_num_timeout)
        first = chunk[0].config
        executor.update_parameters(**sbatch_parameters(settings, first.study, first.threads, at_once))
        try:
            jobs = executor.map_array(task, [run.to_dict() for run in chunk])
        except (FailedJobError, FailedSubmissionError) as error:
            refused += [(run, _what_slurm_says(error)) for run in chunk]
            continue
        new = {job.job_id: run for job, run in zip(jobs, chunk)}
        remember_jobs(folder, new)
        submitted |= new
    return submitted, refused


def _with_cores(settings: SlurmSettings, runs: Sequence[Run]) -> SlurmSettings:
    threads = max(run.config.threads for run in runs)
    cores = settings.cpus_per_task or threads
    if cores < threads:
        raise ConfigurationError(f"hydra.launcher.cpus_per_task: {cores} cores can't hold threads={threads}.")
    return settings.model_copy(update={"cpus_per_task": cores})


def shares(total: int, parts: int) -> list[int]:
    """``total`` jobs at once over so many arrays, at least one each: ``shares(8, 3) == [3, 3, 2]``."""
    return [max(1, total // parts + (part < total % parts)) for part in range(parts)]


def sbatch_parameters(settings: SlurmSettings, name: str, run_threads: int, at_once: int) -> dict[str, Any]:
    """For ``sbatch``, in submitit's spelling."""
    given = {
        "job_name": name,
        "partition": settings.partition,
        "account": settings.account,
        "time": settings.timeout_min,
        "mem": f"{round(settings.mem_gb * 1024)}MB",
        "cpus_per_task": settings.cpus_per_task,
        "array_parallelism": at_once,
        "signal_delay_s": settings.signal_delay_s,
        "setup": [*_own_setup(run_threads), *(settings.setup or [])],
        # srun takes neither from sbatch
        "srun_args": [f"--cpus-per-task={settings.cpus_per_task}", "--open-mode=append"],
        "additional_parameters": {"requeue": True} | (settings.additional_parameters or {}),
    }
    return {key: value for key, value in given.items() if value is not None}


def _own_setup(run_threads: int) -> list[str]:
    """A job finds the code and has its threads even where the cluster gives jobs a bare environment."""
    exports = {"PYTHONPATH": os.environ.get("PYTHONPATH", str(ROOT))} | thread_environment(run_threads)
    return [f"cd {shlex.quote(str(ROOT))}"] + [f"export {key}={shlex.quote(value)}" for key, value in exports.items()]


def _what_slurm_says(error: Exception) -> str:
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    refusals = [line for line in lines if line.startswith("sbatch:")]
    return " ".join(refusals or lines[-1:])
