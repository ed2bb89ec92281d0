"""Experience replay: TorchRL's replay buffer over an append-only log of float32 transitions in one memory map.

Transitions are sampled uniformly, with replacement, from the last ``capacity`` of the log, by a generator of their own.

A row of the file is ``observation [N], action [M], reward, next_observation [N], terminated``: 4 * (2N + M + 2) bytes.
There is no header and nothing in it is ever unpickled. Because rows are only appended, a checkpoint needs to record a
length and nothing else, and never races with what is written after it.

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
from torchrl.data.replay_buffers import RandomSampler, ReplayBuffer, Storage

from src.algorithms.learner import Batch
from src.training.checkpoint import CorruptState
from src.training.collection import Transitions

_CHUNK_BYTES = 32 * 2**20
_FLOAT_BYTES = 4
_ZEROS = bytes(2**20)


class Replay(ReplayBuffer):
    """TorchRL's replay buffer over the file of transitions, empty; a resumed run truncates ``log`` to its checkpoint.

    ``extend(transitions)`` appends :class:`Transitions`; ``sample(B)`` gives the columns of B transitions.

    Args:
        log: the transitions on disk.
        capacity: transitions are sampled from the last ``capacity``.
        generator: the replay's own random stream; its state belongs to the checkpoint.
    """

    def __init__(self, log: TransitionLog, capacity: int, generator: torch.Generator) -> None:
        super().__init__(
            storage=log, sampler=WindowSampler(capacity), collate_fn=lambda columns: columns, generator=generator
        )
        self.log, self.generator = log, generator


def sample_minibatches(buffer: Replay, count: int, batch_size: int) -> Batch:
    """The minibatches of a burst of ``count`` updates in one draw: the replay does not change during the burst.

    Observations are as they were observed: not normalised.
    """
    columns = buffer.sample(count * batch_size)
    return Batch(*(column.view(count, batch_size, *column.shape[1:]) for column in columns))


class WindowSampler(RandomSampler):
    """Uniform, with replacement, over the last ``capacity`` of L: index ~ U{max(0, L - capacity), ..., L - 1}."""

    def __init__(self, capacity: int) -> None:
        self.capacity = capacity

    def sample(self, storage: Storage, batch_size: int) -> tuple[Tensor, dict]:
        """Indices [batch_size], from the replay's generator."""
        length = len(storage)
        if length == 0:
            raise RuntimeError("the replay is empty")
        return torch.randint(max(0, length - self.capacity), length, (batch_size,), generator=self._rng), {}


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
        self._widths = (observation_size, action_size, 1, observation_size, 1)
        self._row_bytes = sum(self._widths) * _FLOAT_BYTES
        self._length = 0
        self._map: mmap.mmap | None = None
        self._rows = torch.empty(0, sum(self._widths))
        path.touch(0o644)
        self._open_map()

    def __len__(self) -> int:
        return self._length

    def set(self, cursor: Any, data: Transitions, *, set_cursor: bool = True) -> None:
        """Append transitions [F], whatever TorchRL's cursor says (it begins anew at a resume): the length is the log's.

        Raises:
            OSError: no space (``ENOSPC``, ``EDQUOT``) or the file may not grow (``EFBIG``); nothing has been appended.
            IndexError: more than ``rows`` transitions.
        """
        start, stop = self._length, self._length + len(data.reward)
        if stop > self.max_size:
            raise IndexError(f"{self.path.name} holds {start} of at most {self.max_size} transitions; no room for more")
        if stop > len(self._rows):
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

    def get(self, index: Tensor) -> tuple[Tensor, ...]:
        """``observation, action, reward, next_observation, terminated`` at the indices [B]: new, contiguous tensors."""
        rows = torch.as_tensor(index)  # TorchRL's own indexing gives an array
        return tuple(torch.index_select(column, 0, rows) for column in self._columns)

    def truncate(self, length: int) -> None:
        """Hold exactly the first ``length`` transitions of the file: how a resumed run goes back to its checkpoint.

        Raises:
            CorruptState: the file is shorter than that.
        """
        if length > len(self._rows):
            raise CorruptState(
                f"{self.path.name} has room for {len(self._rows)} transitions and the checkpoint counts on {length}: "
                "the file was cut short or deleted. Start the run over with on_conflict=replace."
            )
        self._length = length

    def flush(self) -> None:
        """Force all rows to the disk (a killed process needs no flush; a power cut does)."""
        if self._map is not None:
            self._map.flush()

    def _grow(self, needed: int) -> None:
        chunk = max(1, _CHUNK_BYTES // self._row_bytes)
        target = min(self.max_size, max(needed, len(self._rows) + chunk))
        old, new = len(self._rows) * self._row_bytes, target * self._row_bytes
        with self.path.open("r+b") as file:
            try:
                _allocate(file.fileno(), old, new)
            except OSError as error:
                file.truncate(old)
                raise OSError(
                    error.errno,
                    f"no space for the replay to grow to {new / 1e6:.0f} MB ({error.strerror})",
                    str(self.path),
                ) from error
        self._open_map()

    def _open_map(self) -> None:
        """Map the whole rows of the file."""
        rows = min(self.path.stat().st_size // self._row_bytes, self.max_size)
        if rows > 0:
            with self.path.open("r+b") as file:
                self._map = mmap.mmap(file.fileno(), rows * self._row_bytes)
            self._rows = torch.frombuffer(self._map, dtype=torch.float32).view(rows, -1)
        observation, action, reward, next_observation, terminated = self._rows.split(self._widths, dim=1)
        self._columns = (observation, action, reward[:, 0], next_observation, terminated[:, 0])


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
