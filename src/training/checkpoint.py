"""Checkpoints that count only when whole: written beside, synced, renamed; the previous one stays until then.

A file is a magic line, the SHA-256 of what follows, and a ``torch.save`` archive read with ``weights_only=True``:
nothing here unpickles objects. A truncated or corrupt file is recognised by its hash and the one before it is used.
"""

from __future__ import annotations

import hashlib
import io
from pathlib import Path
from typing import Any

import torch

from src.config.schema import ProtocolConfig
from src.experiment.files import replace_file
from src.experiment.progress import Progress
from src.experiment.run_directory import CHECKPOINTS, RunDirectory

_MAGIC = b"spiking-actor-checkpoint 1\n"
_KEEP = 2


class CorruptState(RuntimeError):
    """Saved state (a checkpoint, the replay) that is missing, cut short or does not fit the run."""


def write_archive(path: Path, content: dict[str, Any]) -> None:
    """Write ``content`` (tensors and plain containers) atomically and durably to ``path``."""
    buffer = io.BytesIO()
    torch.save(content, buffer)
    body = buffer.getvalue()
    replace_file(path, _MAGIC + hashlib.sha256(body).digest() + body)


def read_archive(path: Path) -> dict[str, Any]:
    """Read what :func:`write_archive` wrote.

    Raises:
        CorruptState: the file is truncated, altered, or something else.
    """
    data = memoryview(path.read_bytes())
    digest, body = data[len(_MAGIC) : len(_MAGIC) + 32], data[len(_MAGIC) + 32 :]
    if bytes(data[: len(_MAGIC)]) != _MAGIC or hashlib.sha256(body).digest() != bytes(digest):
        raise CorruptState(f"{path.name} is truncated or not a checkpoint")
    content: dict[str, Any] = torch.load(io.BytesIO(body), weights_only=True, map_location="cpu")
    return content


def checkpoint_paths(folder: Path) -> list[Path]:
    """The checkpoints in a run's ``state/`` folder, newest step first."""
    return sorted(folder.glob(CHECKPOINTS), reverse=True)


def save_checkpoint(folder: Path, step: int, content: dict[str, Any]) -> None:
    """Write the checkpoint of ``step`` into ``folder`` and drop all but the newest two."""
    write_archive(folder / f"checkpoint-{step:012d}.pt", content)
    for old in checkpoint_paths(folder)[_KEEP:]:
        old.unlink()


def newest_checkpoint(run: RunDirectory, progress: Progress) -> dict[str, Any] | None:
    """The content of the newest whole checkpoint; None for a run that has not written one yet.

    Raises:
        CorruptState: the run has written checkpoints, and none of them is left whole.
    """
    notes: list[str] = []
    for path in checkpoint_paths(run.state):
        try:
            return read_archive(path)
        except (CorruptState, OSError) as error:
            notes.append(f"passed over {path.name}: {error}")
            progress.note(notes[-1])
    if notes:
        raise CorruptState(
            "no whole checkpoint is left (" + "; ".join(notes) + "): start this run over with "
            "on_conflict=replace, or restore its state/ folder from a backup"
        )
    if (step := run.manifest.checkpoint_step) is not None:
        raise CorruptState(
            f"the checkpoint of step {step} is gone: restore this run's state/ folder, or start the run over "
            "with on_conflict=replace"
        )
    return None


def check_logs(run: RunDirectory, protocol: ProtocolConfig, step: int) -> None:
    """Refuse to go on behind rows that are gone: the curve would lack its beginning in silence.

    Args:
        run: the run directory.
        protocol: when rows are written.
        step: of the checkpoint that the run goes on from.

    Raises:
        CorruptState: a log lacks rows that were written before the checkpoint.
    """
    points = range(0, step + 1, protocol.evaluation_interval)
    expected = {
        run.evaluations: [point for point in points for _ in range(protocol.evaluation_episodes)],
        run.training: list(points[1:]),
    }
    for log, steps in expected.items():
        try:
            whole = log.steps(step) == steps
        except ValueError:
            whole = False
        if not whole:
            raise CorruptState(
                f"{log.path.name} was changed or deleted: its rows up to step {step} are not those that "
                "this run wrote. Restore the file, or start the run over with on_conflict=replace."
            )
