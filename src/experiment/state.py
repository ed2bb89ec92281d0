"""What a run directory says about its run, read in one place: its state, what to do next, and exit codes over both."""

from __future__ import annotations

from collections.abc import Mapping
from enum import IntEnum, StrEnum
from pathlib import Path
from typing import NamedTuple

from filelock import FileLock, Timeout

from src.config.identity import Run, differences, hashed_values
from src.config.schema import ENGINE
from src.config.validation import to_dict
from src.experiment.machine import boot_token
from src.experiment.run_directory import Manifest, ManifestError, RunDirectory, RunState, seconds_since

#: A running manifest of another machine with an older sign of life belongs to a dead process.
FRESH_SECONDS = 300.0
#: Kinds of failure that trying again can't mend: with on_conflict=replace such a run starts over.
DAMAGED = frozenset({"CorruptState", "CorruptCheckpoint"})  # the second: in older manifests


class ExitCode(IntEnum):
    """Of ``python -m src.run``, of ``src.status`` and of one job."""

    DONE = 0  # everything asked for is complete or diverged
    FAILED = 1  # at least one run failed; the summary says which and where to read why
    REFUSED = 2  # bad input: nothing was started
    BUSY = 69  # of one job: another live process holds its run directory
    INTERRUPTED = 75  # stopped by a signal, or runs left to another process: the same command again goes on
    KILLED_BY_USER = 130  # a second Ctrl-C: stopped at once


_FAILED_STATES = frozenset({RunState.FAILED, RunState.NOT_FINISHED})
_ENDED_STATES = frozenset({RunState.COMPLETE, RunState.DIVERGED})


def exit_code(count: Mapping[RunState, int]) -> ExitCode:
    """1 where a run failed, else 75 where something is left to do, else 0."""
    present = {state for state, number in count.items() if number}
    if present & _FAILED_STATES:
        return ExitCode.FAILED
    return ExitCode.DONE if present <= _ENDED_STATES else ExitCode.INTERRUPTED


class Outcome(NamedTuple):
    """How a call of the training ended: ``step`` environment steps are done; ``message`` says why it isn't complete."""

    status: RunState
    step: int
    message: str = ""


class Next(StrEnum):
    """What the plan does with a run."""

    RUN = "run"  # nothing there yet
    RESUME = "resume"  # unfinished, the same configuration
    RETRY = "retry"  # failed before
    EXTEND = "extend"  # complete, and a larger total_steps is asked for
    REPLACE = "replace"  # another configuration's run, to be deleted: on_conflict=replace
    SKIP = "skip"  # complete
    DIVERGED = "diverged"  # ended with non-finite numbers
    BUSY = "busy"  # a live process is at it
    CONFLICT = "conflict"  # refused


#: Actions that start a job.
TO_DO = frozenset({Next.RUN, Next.RESUME, Next.RETRY, Next.EXTEND, Next.REPLACE})


class PlannedRun(NamedTuple):
    """What will be done with a run: ``reason`` says why, for a person; ``step`` is where it stands or goes on."""

    run: Run
    action: Next
    reason: str = ""
    step: int = 0


class RunInspection(NamedTuple):
    """What a run directory holds: ``why`` explains the state, ``held`` says who is at it, if anybody is."""

    state: RunState
    manifest: Manifest | None = None
    why: str = ""
    held: str = ""

    @property
    def step(self) -> int:
        """Environment steps that are done."""
        return self.manifest.step if self.manifest else 0


def inspect_run(path: Path, lock_is_ours: bool = False) -> RunInspection:
    """Read a run directory, which may be written at the same time and need not exist.

    ``lock_is_ours``: the caller holds the lock, so nobody else is at it.
    """
    held = "held by a live process" if not lock_is_ours and held_here(path) else ""
    try:
        manifest = RunDirectory(path).read_manifest()
    except ManifestError as error:
        return RunInspection(RunState.FAILED, None, str(error), held)
    if manifest is None:
        return RunInspection(RunState.RUNNING if held else RunState.NOT_STARTED, None, "", held)
    if not held and not lock_is_ours and alive_elsewhere(path, manifest):
        held = f"running elsewhere, last sign of life {manifest.updated}"
    if manifest.status == RunState.RUNNING and not held:
        return RunInspection(RunState.INTERRUPTED, manifest, "its process is gone")
    why = manifest.failure.message if manifest.failure else ""
    return RunInspection(RunState(manifest.status), manifest, why, held)


def held_here(path: Path) -> bool:
    """Whether a live process that this kernel can see holds the run directory."""
    file = path / "state" / "lock"
    if not file.exists():
        return False
    lock = FileLock(file)
    try:
        lock.acquire(timeout=0)
    except Timeout:
        return True
    except OSError:
        return False  # a lock that we may not even open is no sign of a live process
    lock.release()
    return False


def alive_elsewhere(path: Path, manifest: Manifest | None) -> bool:
    """Whether another machine has given a sign of life within :data:`FRESH_SECONDS`.

    Where a file system doesn't carry locks between machines, that is all we have: a run whose manifest says
    ``running`` and which was acquired under another boot than ours (``state/owner``, a token that names no machine).
    """
    if manifest is None or manifest.status != RunState.RUNNING:
        return False
    try:
        owner = (path / "state" / "owner").read_text()
    except OSError:
        return False
    return owner != boot_token() and seconds_since(manifest.updated) < FRESH_SECONDS


def next_action(run: Run, lock_is_ours: bool = False) -> PlannedRun:
    """What to do with ``run``, given what :func:`inspect_run` finds in its directory."""
    seen = inspect_run(run.path, lock_is_ours)
    manifest = seen.manifest
    if seen.held:
        return PlannedRun(run, Next.BUSY, seen.held, seen.step)
    if manifest is None:
        return PlannedRun(run, Next.RUN) if seen.state == RunState.NOT_STARTED else _conflict(run, seen.why)
    if manifest.configuration_hash != run.configuration_hash:
        return _conflict(run, _difference(run, manifest))
    asked = run.config.protocol.total_steps
    step = seen.step
    if seen.state == RunState.DIVERGED:
        return PlannedRun(run, Next.DIVERGED, seen.why, step)
    if asked < step:
        return _conflict(run, f"protocol.total_steps={asked} is smaller than the {step} steps already done.")
    if seen.state == RunState.COMPLETE:
        return _after_the_end(run, asked, step)
    if seen.state == RunState.FAILED:
        if manifest.failure and manifest.failure.kind in DAMAGED and run.config.on_conflict == "replace":
            return _conflict(run, seen.why)
        return PlannedRun(run, Next.RETRY, f"failed at step {step}" + (f": {seen.why}" if seen.why else ""), step)
    return PlannedRun(run, Next.RESUME, f"stopped at about step {step}", step)


def _after_the_end(run: Run, asked: int, step: int) -> PlannedRun:
    if asked == step:
        return PlannedRun(run, Next.SKIP, "", step)
    if RunDirectory(run.path).can_be_extended:
        return PlannedRun(run, Next.EXTEND, f"from {step} to {asked} steps", step)
    reason = (
        f"it is complete at {step} steps and can't be extended to {asked}: its replay and checkpoint "
        "were not kept (keep_replay=true, given from the start, keeps them)."
    )
    return _conflict(run, reason)


def _conflict(run: Run, reason: str) -> PlannedRun:
    if run.config.on_conflict == "replace":
        return PlannedRun(run, Next.REPLACE, f"the old run is deleted when the job starts: {reason}")
    return PlannedRun(run, Next.CONFLICT, reason)


def _difference(run: Run, manifest: Manifest) -> str:
    old = RunDirectory(run.path).read_config()
    if old is None:
        return "it holds a run of another configuration (its config.yaml can't be read)."
    changes = [str(each) for each in differences(hashed_values(old), hashed_values(to_dict(run.config)))]
    if manifest.engine != ENGINE:
        changes.append(f"engine: {manifest.engine} -> {ENGINE} (the code's results have moved since)")
    if not changes:
        return "its configuration hash differs, but not its config.yaml: somebody has changed one of the two."
    return "it holds a run of another configuration; " + ", ".join(changes) + "."


class RunResult(NamedTuple):
    """How a run stands at the end of a command: ``read`` is where a person reads more, if not in its directory."""

    run: Run
    state: RunState
    why: str = ""
    read: Path | None = None


def result_of(run: Run, cause_of_death: str | None = None) -> RunResult:
    """How ``run`` stands now that its process is gone; a launcher may have seen more than the manifest knows."""
    seen = inspect_run(run.path)
    log = run.path / "state" / "log.txt"
    failure = run.path / "failure.txt"
    if seen.state == RunState.FAILED:
        return RunResult(run, seen.state, seen.why, failure if failure.exists() else log)
    if seen.manifest is not None and seen.manifest.status != RunState.RUNNING:
        return RunResult(run, seen.state, seen.why)
    if held_here(run.path):
        return RunResult(run, RunState.BUSY, "held by a live process", log)
    return RunResult(run, RunState.NOT_FINISHED, cause_of_death or "it ended without a word", log)
