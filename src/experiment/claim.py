"""Take a run directory for this process, look again under the lock, and make it ready for the trainer."""

from __future__ import annotations

import dataclasses
import shutil
from collections.abc import Iterator
from contextlib import contextmanager

from filelock import Timeout

from src.config import ENGINE, ConfigurationError, ExperimentConfig
from src.experiment import lock, machine
from src.experiment import manifest as manifests
from src.experiment.decision import Action, Decision, decide
from src.experiment.hashing import cell_hash, configuration_hash
from src.experiment.labels import changed_keys, label_of
from src.experiment.manifest import Manifest
from src.experiment.run_directory import FILES, RESERVE_FILE, RunDirectory


class BusyError(Exception):
    """A live process holds the run directory."""


@contextmanager
def claim(config: ExperimentConfig) -> Iterator[tuple[RunDirectory, Decision]]:
    """Hold the run directory of ``config``; where there is work to do its manifest says ``running`` on entry.

    Raises:
        BusyError: another live process holds it.
        ConfigurationError: another configuration has used it meanwhile.
        OSError: it can't be written.
    """
    run = RunDirectory(RunDirectory.path_of(config))
    held = lock.lock_of(run.path)
    try:
        held.acquire(timeout=lock.CLAIM_SECONDS)
    except Timeout:
        raise BusyError(f"{run.name}: held by a live process") from None
    try:
        if not lock.wait_for_silence(run.path):
            raise BusyError(f"{run.name}: running on another machine")
        decision = decide(config, lock_is_ours=True)
        if decision.action is Action.CONFLICT:
            raise ConfigurationError(refusal(run.name, decision))
        if decision.action not in (Action.SKIP, Action.DIVERGED):
            run.remove_leftovers()
            run.reserve()
            lock.sign_owner(run.path)
            prepare(run, config, decision)
        yield run, decision
    finally:
        held.release()


def refusal(name: str, decision: Decision) -> str:
    """Why a cell is refused and what to do."""
    return (
        f"{name}: {decision.reason} Choose another place (study=..., or label=... for a variant), "
        "or on_conflict=replace to delete the old run."
    )


def prepare(run: RunDirectory, config: ExperimentConfig, decision: Decision) -> None:
    """Write ``config.yaml`` where the run is new, and a manifest that says ``running``."""
    fresh = Manifest(
        algo=config.algo.name,
        env=config.env.name,
        actor=config.actor.name,
        label=label_of(config),
        encoder=config.encoder.coding,
        seed=config.seed,
        study=config.study,
        changed_keys=changed_keys(config),
        configuration_hash=configuration_hash(config),
        cell_hash=cell_hash(config),
        engine=ENGINE,
        total_steps=config.protocol.total_steps,
        threads=config.threads,
        device=config.device,
        started=manifests.now(),
        versions=machine.versions(),
        processor=machine.processor(),
    )
    commit, dirty = machine.commit()
    fresh = dataclasses.replace(fresh, commit=commit, dirty=dirty)
    if decision.action in (Action.RUN, Action.REPLACE):
        _clear(run)
        run.write_config(config)
        run.write_manifest(fresh)
    else:
        run.write_manifest(_resumed(run, fresh, decision))


def _resumed(run: RunDirectory, fresh: Manifest, decision: Decision) -> Manifest:
    old = run.manifest
    step = old.step
    notes = []
    if decision.action is Action.EXTEND:
        notes.append(f"extended from {step} to {fresh.total_steps} steps")
    for key in ("processor", "versions", "commit"):
        before, after = getattr(old, key), getattr(fresh, key)
        if key == "versions":  # a package that an older manifest did not list is not news
            after = {name: version for name, version in after.items() if name in before}
        if before != after:
            notes.append(f"resumed at about step {step} with another {key}: {_told(before, after)}")
    for note in notes:
        run.log.warning(note)
    return dataclasses.replace(
        fresh,
        step=step,
        checkpoint_step=old.checkpoint_step,
        observation_size=old.observation_size,
        action_size=old.action_size,
        parameters=old.parameters,
        blas=old.blas,
        started=old.started,
        wall_time_seconds=old.wall_time_seconds,
        times_resumed=old.times_resumed + 1,
        notes=old.notes + notes,
    )


def _told(before: object, after: object) -> str:
    if isinstance(before, dict) and isinstance(after, dict):
        names = sorted(name for name in before.keys() | after.keys() if before.get(name) != after.get(name))
        return ", ".join(f"{name} {before.get(name)} -> {after.get(name)}" for name in names)
    return f"{before} -> {after}"


def _clear(run: RunDirectory) -> None:
    """Delete what an old run has left, but for the lock that we hold and the log that we may be writing."""
    for name in FILES:
        (run.path / name).unlink(missing_ok=True)
    for entry in run.state.iterdir():
        if entry.name in ("lock", "owner", "log.txt", RESERVE_FILE):
            continue
        if entry.is_dir() and not entry.is_symlink():
            shutil.rmtree(entry)
        else:
            entry.unlink()
