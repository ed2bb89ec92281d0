"""What to do with one cell of the grid, given what its run directory holds. Reads files only."""

from __future__ import annotations

from enum import StrEnum
from typing import NamedTuple

from src.config import ENGINE, ExperimentConfig, to_dict
from src.experiment.hashing import configuration_hash, differing_keys
from src.experiment.lock import alive_elsewhere, held_here
from src.experiment.manifest import Manifest, ManifestError
from src.experiment.run_directory import RunDirectory


class Action(StrEnum):
    """The words that the plan uses."""

    RUN = "run"  # nothing there yet
    RESUME = "resume"  # unfinished, the same configuration
    RETRY = "retry"  # failed before
    EXTEND = "extend"  # complete, and a larger total_steps is asked for
    REPLACE = "replace"  # another configuration's run, to be deleted: on_conflict=replace
    SKIP = "skip"  # complete
    DIVERGED = "diverged"  # ended with non-finite numbers: it has told what it had to tell
    BUSY = "busy"  # a live process is at it
    CONFLICT = "conflict"  # refused


#: Actions that start a job.
TO_DO = frozenset({Action.RUN, Action.RESUME, Action.RETRY, Action.EXTEND, Action.REPLACE})

#: Kinds of failure that trying again can't mend: with on_conflict=replace such a run starts over.
DAMAGED = frozenset({"CorruptCheckpoint", "CorruptState"})


class Decision(NamedTuple):
    """``reason`` says why, for a person; ``step`` is where the run stands."""

    action: Action
    reason: str = ""
    step: int = 0


def decide(config: ExperimentConfig, lock_is_ours: bool = False) -> Decision:
    """Look at the run directory of ``config``.

    Args:
        config: the cell.
        lock_is_ours: the caller holds the lock, so nobody else is at it.
    """
    run = RunDirectory(RunDirectory.path_of(config))
    try:
        manifest = run.read_manifest()
    except ManifestError as error:
        if not lock_is_ours and held_here(run.path):
            return Decision(Action.BUSY, "held by a live process")
        return _conflict(config, str(error), 0)
    if not lock_is_ours:
        if held_here(run.path):
            return Decision(Action.BUSY, "held by a live process", manifest.step if manifest else 0)
        if manifest is not None and alive_elsewhere(run.path, manifest):
            return Decision(Action.BUSY, f"running elsewhere, last sign of life {manifest.updated}", manifest.step)
    if manifest is None:
        return Decision(Action.RUN)
    if manifest.configuration_hash != configuration_hash(config):
        return _conflict(config, _difference(run, manifest, config), manifest.step)
    return _same_configuration(run, manifest, config)


def _same_configuration(run: RunDirectory, manifest: Manifest, config: ExperimentConfig) -> Decision:
    asked, step = config.protocol.total_steps, manifest.step
    if manifest.status == "diverged":
        return Decision(Action.DIVERGED, manifest.failure.message if manifest.failure else "", step)
    if asked < step:
        reason = f"protocol.total_steps={asked} is smaller than the {step} steps already done."
        return _conflict(config, reason, step)
    if manifest.status == "complete":
        if asked == step:
            return Decision(Action.SKIP, "", step)
        if not run.can_be_extended:
            reason = (
                f"it is complete at {step} steps and can't be extended to {asked}: its replay and checkpoint "
                "were not kept (keep_replay=true, given from the start, keeps them)."
            )
            return _conflict(config, reason, step)
        return Decision(Action.EXTEND, f"from {step} to {asked} steps", step)
    if manifest.status == "failed":
        if manifest.failure and manifest.failure.kind in DAMAGED and config.on_conflict == "replace":
            return _conflict(config, manifest.failure.message, step)
        why = f"failed at step {step}: {manifest.failure.message}" if manifest.failure else f"failed at step {step}"
        return Decision(Action.RETRY, why, step)
    return Decision(Action.RESUME, f"stopped at about step {step}", step)


def _conflict(config: ExperimentConfig, reason: str, step: int) -> Decision:
    if config.on_conflict == "replace":
        return Decision(Action.REPLACE, f"the old run is deleted when the job starts: {reason}", step)
    return Decision(Action.CONFLICT, reason, step)


def _difference(run: RunDirectory, manifest: Manifest, config: ExperimentConfig) -> str:
    old = run.read_config()
    if old is None:
        return "it holds a run of another configuration (its config.yaml can't be read)."
    changes = [f"{key}: {old} -> {new}" for key, old, new in differing_keys(old, to_dict(config))]
    if manifest.engine != ENGINE:
        changes.append(f"engine: {manifest.engine} -> {ENGINE} (the code's results have moved since)")
    if not changes:
        return "its configuration hash differs, but not its config.yaml: somebody has changed one of the two."
    return "it holds a run of another configuration; " + ", ".join(changes) + "."
