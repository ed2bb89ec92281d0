"""How a cell ended whose Slurm job is over: from its manifest, and from Slurm where the job could not write there."""

from __future__ import annotations

from pathlib import Path

from filelock import Timeout

from src.experiment import lock
from src.experiment.closing import Ending, ending
from src.experiment.hashing import configuration_hash
from src.experiment.manifest import ManifestError
from src.experiment.plan import Cell
from src.experiment.pool import record_death
from src.experiment.slurm.queue import GONE, INTERRUPTING, JobState

_WORDS = {
    "CANCELLED": "cancelled in Slurm",
    "TIMEOUT": "stopped by Slurm's time limit",
    "PREEMPTED": "preempted by Slurm",
    "OUT_OF_MEMORY": "out of memory: more than hydra.launcher.mem_gb",
    "NODE_FAIL": "its node failed",
    "GONE": "its job has left Slurm's queue",
}


def ending_in_slurm(cell: Cell, job: str, state: JobState, folder: Path) -> Ending:
    """How ``cell`` stands now that its ``job`` is over; a manifest that still says ``running`` is put right."""
    log = folder / f"{job}_0_log.err"
    word = _WORDS.get(state.state, f"its job ended in Slurm as {state.state}")
    if state.state in INTERRUPTING:
        _record_interruption(cell)
        end = ending(cell, word)
        if end.state == "interrupted" or not (cell.run.path / "manifest.json").exists():
            return end._replace(state="interrupted", why=f"{word} (job {job})")
        return end
    if state.state != "COMPLETED":
        # a job that Slurm saw die leaves no `interrupted` behind: it is of an earlier job, or there was no requeue
        unfinished = ("running",) if state == GONE else ("running", "interrupted")
        record_death(cell, f"{word} (Slurm job {job})", unfinished)
    end = ending(cell, word)
    if state.state == "FAILED" and not _is_ours(cell):
        return end._replace(state="failed", why=word, read=log)
    if state.state == "COMPLETED" and end.state == "not finished":  # a job returns from an unfinished run only then
        return end._replace(state="busy", why="held by another process", read=log.with_suffix(".out"))
    silent = end.state == "not finished" or end.why.endswith(f"(Slurm job {job})")  # no traceback in failure.txt
    return end._replace(read=log) if silent else end


def _record_interruption(cell: Cell) -> None:
    """``interrupted`` in the manifest, unless somebody else has claimed the run meanwhile."""
    if not cell.run.path.exists():
        return
    held = lock.lock_of(cell.run.path)
    try:
        held.acquire(timeout=lock.CLAIM_SECONDS)
    except Timeout:
        return
    try:
        manifest = cell.run.read_manifest()
        if manifest is not None and manifest.status == "running":
            cell.run.write_manifest(manifest)
            cell.run.update_manifest(status="interrupted")
    except (OSError, ManifestError):
        pass  # the closing table reads the manifest again and says what is wrong with it
    finally:
        held.release()


def _is_ours(cell: Cell) -> bool:
    """Whether the manifest is of this configuration: a job may find another run in its place."""
    try:
        manifest = cell.run.read_manifest()
    except ManifestError:
        return True
    return manifest is not None and manifest.configuration_hash == configuration_hash(cell.config)
