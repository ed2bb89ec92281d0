"""What Slurm says about this user's jobs. ``squeue`` and ``scontrol`` are enough: no accounting service is needed."""

from __future__ import annotations

import os
import re
import subprocess
from typing import NamedTuple

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
