"""What Slurm says about this user's jobs, which of them is at which run, and how a run ended whose job is over.

``squeue`` and ``scontrol`` are enough: no accounting service is needed.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import time
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from src.config.identity import Run
from src.experiment.display import SweepDisplay
from src.experiment.ownership import record_death
from src.experiment.run_directory import ManifestError, RunDirectory, RunState
from src.experiment.state import RunResult, result_of

_JOBS_FILE = "jobs.jsonl"
#: A changed state of the queue is shown at most this often.
_REPORT_SECONDS = 30.0
#: Silence of Slurm is reported this often.
_SILENCE_SECONDS = 300.0
#: Slurm's own default of MaxArraySize; indices begin at 0.
DEFAULT_ARRAY_LIMIT = 1001
#: States in which a job is over for good. A requeued job is PENDING.
OVER = frozenset(
    {
        *("COMPLETED", "FAILED", "CANCELLED", "TIMEOUT", "OUT_OF_MEMORY", "NODE_FAIL"),
        *("PREEMPTED", "BOOT_FAIL", "DEADLINE", "REVOKED", "GONE"),
    }
)
#: Not the run's fault: the same command again resumes it.
INTERRUPTING = frozenset({"CANCELLED", "TIMEOUT", "PREEMPTED"})
#: Other ends, for a person.
_WORDS = {
    "CANCELLED": "cancelled in Slurm",
    "TIMEOUT": "stopped by Slurm's time limit",
    "PREEMPTED": "preempted by Slurm",
    "OUT_OF_MEMORY": "out of memory: more than hydra.launcher.mem_gb",
    "NODE_FAIL": "its node failed",
    "GONE": "its job has left Slurm's queue",
}


class QueueError(Exception):
    """Slurm doesn't answer."""


class JobState(NamedTuple):
    """``state`` in Slurm's words; ``reason`` why a job waits; ``name`` of the job."""

    state: str
    reason: str
    name: str

    @property
    def over(self) -> bool:
        """Whether the job will not run (again)."""
        return self.state in OVER


#: A job that Slurm doesn't know (any more).
GONE = JobState("GONE", "", "")


def job_states() -> dict[str, JobState]:
    """Every job of this user that Slurm remembers (for some minutes after its end), by id: ``12`` or ``12_3``.

    Raises:
        QueueError: no answer, so nothing is known about any job.
    """
    answer = _ask("squeue", "--noheader", "--array", "--states=all", f"--user={os.getuid()}", "--format=%i|%T|%r|%j")
    states = {}
    for line in answer.splitlines():
        job, state, reason, name = line.strip().split("|", 3)
        states[job] = JobState(state, reason, name)
    return states


def array_ids(jobs: Iterable[str]) -> list[str]:
    """The arrays that jobs belong to: ``["12", "13"]``."""
    return list(dict.fromkeys(job.partition("_")[0] for job in jobs))


def array_limit() -> int:
    """How many tasks one array may have."""
    try:
        found = re.search(r"^MaxArraySize\s*=\s*(\d+)", _ask("scontrol", "show", "config"), re.MULTILINE)
    except QueueError:
        found = None
    return max(1, int(found.group(1))) if found else DEFAULT_ARRAY_LIMIT


def _ask(*command: str) -> str:
    try:
        return subprocess.run(command, capture_output=True, text=True, timeout=120, check=True).stdout
    except subprocess.CalledProcessError as error:
        raise QueueError(error.stderr.strip() or f"{command[0]} exited with {error.returncode}") from None
    except (OSError, subprocess.TimeoutExpired) as error:
        raise QueueError(str(error)) from None


def result_in_slurm(run: Run, job: str, state: JobState, folder: Path) -> RunResult:
    """How ``run`` stands now that its ``job`` is over; a manifest that still says ``running`` is corrected."""
    log = folder / f"{job}_0_log.err"
    word = _WORDS.get(state.state, f"its job ended in Slurm as {state.state}")
    if state.state in INTERRUPTING:
        record_death(run, word, status=RunState.INTERRUPTED)
        result = result_of(run, word)
        if result.state == RunState.INTERRUPTED or not (run.path / "manifest.json").exists():
            return result._replace(state=RunState.INTERRUPTED, why=f"{word} (job {job})")
        return result
    if state.state != "COMPLETED":
        # a job that Slurm saw die leaves no `interrupted` behind: it is of an earlier job, or there was no requeue
        unfinished = (RunState.RUNNING,) if state == GONE else (RunState.RUNNING, RunState.INTERRUPTED)
        record_death(run, f"{word} (Slurm job {job})", unfinished)
    result = result_of(run, word)
    if state.state == "FAILED" and not _is_ours(run):
        return result._replace(state=RunState.FAILED, why=word, read=log)
    silent = result.state == RunState.NOT_FINISHED
    if state.state == "COMPLETED" and silent:  # a job returns from an unfinished run only then
        return result._replace(state=RunState.BUSY, why="held by another process", read=log.with_suffix(".out"))
    no_traceback = silent or result.why.endswith(f"(Slurm job {job})")
    return result._replace(read=log) if no_traceback else result


def _is_ours(run: Run) -> bool:
    """Whether the manifest is of this configuration: a job may find another run in its place."""
    try:
        manifest = RunDirectory(run.path).read_manifest()
    except ManifestError:
        return True
    return manifest is not None and manifest.configuration_hash == run.configuration_hash


def remember_jobs(folder: Path, jobs: Mapping[str, Run]) -> None:
    """Append one line per job to a log beside submitit's files, all of them in one write."""
    lines = [json.dumps({"job": job, "run": _relative(folder, run)}) + "\n" for job, run in jobs.items()]
    with (folder / _JOBS_FILE).open("ab", buffering=0) as file:  # one write: another command may append too
        file.write("".join(lines).encode())


def last_jobs(folder: Path, runs: Sequence[Run]) -> list[str | None]:
    """For each run the job that was submitted last, if ever one was."""
    jobs: dict[str, str] = {}
    path = folder / _JOBS_FILE
    for line in path.read_text().splitlines() if path.exists() else ():
        try:
            entry = json.loads(line)
            jobs[entry["run"]] = entry["job"]
        except (ValueError, KeyError, TypeError):
            continue  # a torn line: at worst a run waits in the queue twice, and its lock sorts that out
    return [jobs.get(_relative(folder, run)) for run in runs]


def _relative(folder: Path, run: Run) -> str:
    """Relative, so that it doesn't matter where the file system is mounted."""
    return os.path.relpath(run.path, folder)


class Watch:
    """Follows jobs until the last is over; ``run`` returns how each run ended."""

    def __init__(self, jobs: Mapping[str, Run], folder: Path, poll_seconds: float, display: SweepDisplay) -> None:
        self._jobs = dict(jobs)
        self._folder = folder
        self._poll_seconds = poll_seconds
        self._display = display
        self._seen_over: dict[str, str] = {}
        self._began = time.monotonic()
        self._reported: tuple[float, str] = (-float("inf"), "")
        self._silent_since = self._began

    def run(self) -> list[RunResult]:
        """Wait for all."""
        results: list[RunResult] = []
        try:
            while self._jobs:
                time.sleep(self._poll_seconds)
                results += self._poll()
        except KeyboardInterrupt:
            self._display.note(
                "the jobs go on in Slurm, and the same command again looks after them; "
                f"`scancel {' '.join(array_ids(self._jobs))}` would cancel them"
            )
        return results + left_in_slurm(self._jobs)

    def _poll(self) -> list[RunResult]:
        try:
            states = job_states()
        except QueueError as error:
            if time.monotonic() - self._silent_since >= _SILENCE_SECONDS:
                self._silent_since = time.monotonic()
                self._display.note(f"Slurm doesn't answer: {error}")
            return []
        self._silent_since = time.monotonic()
        now = {job: states.get(job, GONE) for job in self._jobs}
        results = []
        for job, state in now.items():
            if self._is_over(job, state):
                result = result_in_slurm(self._jobs.pop(job), job, state, self._folder)
                self._display.ended(result, time.monotonic() - self._began)
                results.append(result)
        self._report(now)
        return results

    def _is_over(self, job: str, state: JobState) -> bool:
        """Twice the same answer: a job may be between an end and a requeue, a file server may show an old manifest."""
        if not state.over:
            self._seen_over.pop(job, None)
            return False
        if self._seen_over.get(job) == state.state:
            list(self._jobs[job].path.parent.glob("*"))  # has a network file system look again
            return True
        self._seen_over[job] = state.state
        return False

    def _report(self, now: Mapping[str, JobState]) -> None:
        count = Counter(
            state.state.lower() + (f" ({state.reason})" if state.state == "PENDING" else "")
            for job, state in now.items()
            if job in self._jobs and not state.over
        )
        text = "Slurm: " + ", ".join(f"{number} {what}" for what, number in sorted(count.items()))
        if "held" in text.lower():
            text += "; a held job waits until `scontrol release JOB`"
        if count and text != self._reported[1] and time.monotonic() - self._reported[0] >= _REPORT_SECONDS:
            self._reported = (time.monotonic(), text)
            self._display.note(text)


def left_in_slurm(jobs: Mapping[str, Run]) -> list[RunResult]:
    """Runs whose jobs go on without us."""
    return [RunResult(run, RunState.BUSY, f"in Slurm's hands as job {job}") for job, run in jobs.items()]
