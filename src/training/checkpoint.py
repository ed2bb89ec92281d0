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

from src.experiment.files import replace_file
from src.experiment.run_directory import CHECKPOINTS
from src.training.errors import CorruptState

_MAGIC = b"spiking-actor-checkpoint 1\n"
_KEEP = 2


def write_archive(path: Path, content: Any) -> None:
    """Write ``content`` (tensors and plain containers) atomically and durably to ``path``."""
    buffer = io.BytesIO()
    torch.save(content, buffer)
    body = buffer.getvalue()
    replace_file(path, _MAGIC + hashlib.sha256(body).digest() + body)


def read_archive(path: Path) -> Any:
    """Read what :func:`write_archive` wrote.

    Raises:
        CorruptState: the file is truncated, altered, or something else.
    """
    data = memoryview(path.read_bytes())
    digest, body = data[len(_MAGIC) : len(_MAGIC) + 32], data[len(_MAGIC) + 32 :]
    if bytes(data[: len(_MAGIC)]) != _MAGIC or hashlib.sha256(body).digest() != bytes(digest):
        raise CorruptState(f"{path.name} is truncated or not a checkpoint")
    return torch.load(io.BytesIO(body), weights_only=True, map_location="cpu")


class CheckpointFolder:
    """The last two checkpoints of a run, ``checkpoint-<step>.pt`` in its ``state/`` folder."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def paths(self) -> list[Path]:
        """Checkpoint files, newest step first."""
        return sorted(self.folder.glob(CHECKPOINTS), reverse=True)

    def save(self, step: int, content: Any) -> None:
        """Write the checkpoint of ``step`` and drop all but the newest two."""
        write_archive(self.folder / f"checkpoint-{step:012d}.pt", content)
        for old in self.paths()[_KEEP:]:
            old.unlink()

    def load(self) -> tuple[Any | None, list[str]]:
        """The newest whole checkpoint (None where there is no file), and notes on corrupt ones passed over.

        Raises:
            CorruptState: there are checkpoint files, and none of them is whole.
        """
        notes: list[str] = []
        for path in self.paths():
            try:
                return read_archive(path), notes
            except (CorruptState, OSError) as error:
                notes.append(f"passed over {path.name}: {error}")
        if notes:
            raise CorruptState(
                "no whole checkpoint is left (" + "; ".join(notes) + "): start this run over with "
                "on_conflict=replace, or restore its state/ folder from a backup"
            )
        return None, notes
