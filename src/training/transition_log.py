"""The replay on disk: an append-only log of float32 transitions in one memory map.

A row is ``observation [N], action [M], reward, next_observation [N], terminated``: 4 * (2N + M + 2) bytes. The file has
no header and nothing in it is ever unpickled. Because rows are only appended, a checkpoint needs to record a length and
nothing else, and never races with what is written after it.

Space is allocated in chunks *before* it is written: on a full disk a sparse memory map would die of SIGBUS at some
later write; here the append that needs a new chunk raises ``OSError``. (A file system that copies on write may still
break this promise.)
"""

from __future__ import annotations

import errno
import mmap
import os
from pathlib import Path
from typing import Any

import torch
from torch import Tensor
from torchrl.data.replay_buffers import Storage

from src.training.collection import Transitions
from src.training.errors import CorruptState

_CHUNK_BYTES = 32 * 2**20
_FLOAT_BYTES = 4
_ZEROS = bytes(2**20)


class TransitionLog(Storage):
    """A TorchRL storage over a file of at most ``rows`` transitions.

    Args:
        path: the file; created if missing, reused (as empty, until :meth:`truncate`) if there.
        rows: the most transitions it will ever hold, e.g. the run's total steps.
        observation_size: N.
        action_size: M.

    Raises:
        OSError: the file cannot be made, or there is no space for it.
    """

    def __init__(self, path: Path, rows: int, observation_size: int, action_size: int) -> None:
        super().__init__(rows)
        self.path = path
        n, m = observation_size, action_size
        self._widths = (n, m, 1, n, 1)
        self.width = sum(self._widths)
        self._length = 0
        self._file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
        self._map: mmap.mmap | None = None
        self._rows = torch.empty(0, self.width)
        self._columns: tuple[Tensor, ...] = ()
        size = os.fstat(self._file).st_size
        if size >= self._row_bytes:
            self._remap(min(size // self._row_bytes, rows))

    @property
    def _row_bytes(self) -> int:
        return self.width * _FLOAT_BYTES

    @property
    def _allocated(self) -> int:
        return len(self._rows)

    def __len__(self) -> int:
        return self._length

    def append(self, data: Transitions) -> Tensor:
        """Write transitions [F] behind the last one; returns their indices [F].

        Raises:
            OSError: no space (``ENOSPC``, ``EDQUOT``) or the file may not grow (``EFBIG``); nothing has been appended.
            IndexError: more than ``rows`` transitions.
        """
        start, stop = self._length, self._length + len(data.reward)
        if stop > self.max_size:
            raise IndexError(f"{self.path.name} holds {start} of at most {self.max_size} transitions; no room for more")
        if stop > self._allocated:
            self._grow(stop)
        torch.cat(
            (
                data.observation,
                data.action,
                data.reward.unsqueeze(1),
                data.next_observation,
                data.terminated.unsqueeze(1),
            ),
            dim=1,
            out=self._rows[start:stop],
        )
        self._length = stop
        return torch.arange(start, stop)

    def get(self, index: Any) -> tuple[Tensor, ...]:
        """``observation, action, reward, next_observation, terminated`` at the indices [B]: new, contiguous tensors."""
        index = torch.as_tensor(index)
        if self._length == 0 or int(index.max()) >= self._length or int(index.min()) < 0:
            raise IndexError(f"index outside the {self._length} stored transitions")
        return tuple(torch.index_select(column, 0, index) for column in self._columns)

    def truncate(self, length: int) -> None:
        """Hold exactly the first ``length`` transitions of the file: how a resumed run goes back to its checkpoint.

        Raises:
            CorruptState: the file is shorter than that.
        """
        if length > self._allocated:
            raise CorruptState(
                f"{self.path.name} has room for {self._allocated} transitions and the checkpoint counts on {length}: "
                "the file was cut short or deleted. Start the run over with on_conflict=replace."
            )
        self._length = length

    def flush(self, start: int, stop: int) -> None:
        """Force the rows ``start <= row < stop`` to the disk (a killed process needs no flush; a power cut does)."""
        if self._map is not None and stop > start:
            page = mmap.ALLOCATIONGRANULARITY
            offset = start * self._row_bytes // page * page
            self._map.flush(offset, stop * self._row_bytes - offset)

    def close(self) -> None:
        """Let go of the file."""
        if self._file >= 0:
            self._columns, self._rows, self._map = (), torch.empty(0, self.width), None
            os.close(self._file)
            self._file = -1

    def _grow(self, needed: int) -> None:
        chunk = max(1, _CHUNK_BYTES // self._row_bytes)
        target = min(self.max_size, max(needed, self._allocated + chunk))
        old, new = self._allocated * self._row_bytes, target * self._row_bytes
        try:
            _allocate(self._file, old, new)
        except OSError as error:
            os.ftruncate(self._file, old)
            raise OSError(
                error.errno, f"no space for the replay to grow to {new / 1e6:.0f} MB ({error.strerror})", str(self.path)
            ) from error
        self._remap(target)

    def _remap(self, rows: int) -> None:
        self._map = mmap.mmap(self._file, rows * self._row_bytes)
        self._rows = torch.frombuffer(self._map, dtype=torch.float32).view(rows, self.width)
        columns = self._rows.split(self._widths, dim=1)
        self._columns = tuple(c[:, 0] if i in (2, 4) else c for i, c in enumerate(columns))

    def set(self, cursor: Any, data: Any, *, set_cursor: bool = True) -> None:
        """TorchRL's way to write; here only appending is possible, by :meth:`append`."""
        raise NotImplementedError("the transition log only appends")

    def contains(self, item: Any) -> bool:
        """Whether a transition is stored at this index."""
        return 0 <= int(item) < self._length

    def state_dict(self) -> dict[str, Any]:
        """The length; the transitions stay in the file."""
        return {"length": self._length}

    def load_state_dict(self, state_dict: dict[str, Any]) -> None:
        """As :meth:`truncate`."""
        self.truncate(int(state_dict["length"]))

    def _empty(self) -> None:
        self._length = 0


def _allocate(file: int, start: int, stop: int) -> None:
    """Real blocks for the bytes ``start..stop`` of the file, which becomes ``stop`` long.

    Raises:
        OSError: ENOSPC, EDQUOT, EFBIG.
    """
    try:
        os.posix_fallocate(file, start, stop - start)
    except (AttributeError, OSError) as error:  # macOS has no such call, some file systems don't serve it
        if isinstance(error, OSError) and error.errno not in (errno.EOPNOTSUPP, errno.EINVAL, errno.ENOSYS):
            raise
        while start < stop:  # a short write is followed by one that says why
            start += os.pwrite(file, _ZEROS[: stop - start], start)
