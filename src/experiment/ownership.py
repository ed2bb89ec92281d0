"""Who may write in a run directory: one process at a time. How it takes the directory, and makes it ready to train.

Two means, because neither suffices alone: a kernel lock on ``state/lock``, which dies with its owner, so that the lock
of a dead process never blocks; and, where a file system doesn't carry locks between machines, the manifest's sign of
life (:func:`src.experiment.state.alive_elsewhere`). A job that was requeued to another machine waits until that sign
is old or moves.
"""

from __future__ import annotations

import dataclasses
import shutil
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from filelock import FileLock, Timeout

from src.config.identity import Run, differences
from src.config.schema import ENGINE, ConfigurationError
from src.experiment import machine
from src.experiment.files import replace_file
from src.experiment.run_directory import (
    FILES,
    RESERVE_FILE,
    WATCH_FOLDER,
    Failure,
    Manifest,
    ManifestError,
    RunDirectory,
    RunState,
    now,
)
from src.experiment.state import Next, PlannedRun, alive_elsewhere, next_action

#: How long taking the lock is tried: a plan or a status may look at it for an instant.
ACQUIRE_SECONDS = 3.0


class BusyError(Exception):
    """A live process holds the run directory."""


def lock_of(path: Path) -> FileLock:
    """The lock of a run directory (made where it is missing), not yet taken."""
    (path / "state").mkdir(parents=True, exist_ok=True)
    return FileLock(path / "state" / "lock", timeout=ACQUIRE_SECONDS)


@contextmanager
def acquire(run: Run) -> Iterator[tuple[RunDirectory, PlannedRun]]:
    """Hold the directory of ``run``; where there is work to do its manifest says ``running`` on entry.

    Raises:
        BusyError: another live process holds it.
        ConfigurationError: another configuration has used it meanwhile.
        OSError: it can't be written.
    """
    directory = RunDirectory(run.path)
    try:
        held = lock_of(run.path).acquire()
    except Timeout:
        raise BusyError(f"{run.name}: held by a live process") from None
    with held:
        if not wait_for_stale_heartbeat(directory):
            raise BusyError(f"{run.name}: running on another machine")
        found = next_action(run, lock_is_ours=True)
        if found.action is Next.CONFLICT:
            raise ConfigurationError(conflict_message(found))
        if found.action not in (Next.SKIP, Next.DIVERGED):
            directory.remove_leftovers()
            directory.reserve()
            # replaced as a whole: a torn one would look like another machine's
            replace_file(directory.state / "owner", machine.boot_token().encode())
            prepare(directory, found)
        yield directory, found


def conflict_message(found: PlannedRun) -> str:
    """Why a run is refused and what to do."""
    return (
        f"{found.run.name}: {found.reason} Choose another place (study=..., or label=... for a variant), "
        "or on_conflict=replace to delete the old run."
    )


def wait_for_stale_heartbeat(directory: RunDirectory) -> bool:
    """With the lock held: wait until another machine's sign of life is old (True) or has moved (False: it lives)."""
    first = directory.read_manifest()
    while alive_elsewhere(directory.path, current := directory.read_manifest()):
        if current != first:
            return False
        time.sleep(5.0)
    return True


def prepare(directory: RunDirectory, found: PlannedRun) -> None:
    """Write ``config.yaml`` where the run is new, and a manifest that says ``running``."""
    run = found.run
    config = run.config
    commit, dirty = machine.commit()
    fresh = Manifest(
        algo=config.algo.name,
        env=config.env.name,
        actor=config.actor.name,
        label=run.label,
        encoder=config.encoder.coding,
        seed=config.seed,
        study=config.study,
        changed_keys=dict(run.changed_keys),
        hashed_keys=sorted(run.hashed),
        configuration_hash=run.configuration_hash,
        cell_hash=run.cell_hash,
        engine=ENGINE,
        total_steps=config.protocol.total_steps,
        threads=config.threads,
        device=config.device,
        started=now(),
        versions=machine.versions(),
        commit=commit,
        dirty=dirty,
        processor=machine.processor(),
    )
    if found.action in (Next.RUN, Next.REPLACE):
        _clear(directory)
        directory.write_config(run)
        directory.write_manifest(fresh)
    else:
        directory.write_manifest(_resumed(directory, fresh, found))


def _resumed(directory: RunDirectory, fresh: Manifest, found: PlannedRun) -> Manifest:
    old = directory.manifest
    notes = [f"extended from {old.step} to {fresh.total_steps} steps"] if found.action is Next.EXTEND else []
    for key in ("processor", "commit"):
        before = getattr(old, key)
        after = getattr(fresh, key)
        if before != after:
            notes.append(f"resumed at about step {old.step} with another {key}: {before} -> {after}")
    # a package that an older manifest did not list is not news
    listed = {name: version for name, version in fresh.versions.items() if name in old.versions}
    if changes := differences(old.versions, listed):
        packages = ", ".join(f"{each.key} {each.old} -> {each.new}" for each in changes)
        notes.append(f"resumed at about step {old.step} with other versions: {packages}")
    for note in notes:
        directory.log.warning(note)
    return dataclasses.replace(
        fresh,
        step=old.step,
        checkpoint_step=old.checkpoint_step,
        observation_size=old.observation_size,
        action_size=old.action_size,
        parameters=old.parameters,
        blas=old.blas,
        backend=old.backend,
        started=old.started,
        wall_time_seconds=old.wall_time_seconds,
        times_resumed=old.times_resumed + 1,
        notes=old.notes + notes,
    )


def _clear(directory: RunDirectory) -> None:
    """Delete what an old run has left, but for the lock that we hold and the log that we may be writing."""
    for name in FILES:
        (directory.path / name).unlink(missing_ok=True)
    shutil.rmtree(directory.path / WATCH_FOLDER, ignore_errors=True)
    for entry in directory.state.iterdir():
        if entry.name in ("lock", "owner", "log.txt", RESERVE_FILE):
            continue
        if entry.is_dir() and not entry.is_symlink():
            shutil.rmtree(entry)
        else:
            entry.unlink()


def record_failure(directory: RunDirectory, kind: str, message: str, step: int, wall_time_seconds: float) -> None:
    """Set the manifest to ``failed``."""
    directory.update_manifest(
        status=RunState.FAILED,
        finished=now(),
        step=step,
        wall_time_seconds=wall_time_seconds,
        failure=Failure(kind, message, step),
    )


def record_death(
    run: Run, killed: str, unfinished: Sequence[RunState] = (RunState.RUNNING,), status: RunState = RunState.FAILED
) -> None:
    """Write into the manifest what a dead process could not: that it failed, or was interrupted.

    Args:
        run: whose process it was.
        killed: what is known of its death.
        unfinished: the manifest's states that this death puts right.
        status: ``failed``, or ``interrupted`` (which needs no record where the run has not begun).
    """
    directory = RunDirectory(run.path)
    if status == RunState.INTERRUPTED and not (run.path / "manifest.json").exists():
        return
    try:
        with lock_of(run.path):
            manifest = directory.read_manifest()
            if manifest is None:
                prepare(directory, PlannedRun(run, Next.RUN))
            elif manifest.status not in unfinished:
                return
            if status == RunState.INTERRUPTED:
                directory.update_manifest(status=status)
                return
            last = directory.manifest
            record_failure(directory, killed.partition(" (")[0], killed, last.step, last.wall_time_seconds)
    except Timeout:
        return  # somebody else has acquired it meanwhile
    except (OSError, ManifestError) as error:
        print(f"{run.name}: {killed}; that could not be recorded: {error}", file=sys.stderr)
