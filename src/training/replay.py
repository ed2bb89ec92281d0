"""Experience replay: TorchRL's replay buffer over the transition log on disk.

Transitions are sampled uniformly, with replacement, from the last ``capacity`` of the log, by a generator of their own.
"""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor
from torchrl.data.replay_buffers import ReplayBuffer, Storage
from torchrl.data.replay_buffers.samplers import Sampler
from torchrl.data.replay_buffers.writers import Writer

from src.algorithms.learner import Batch
from src.training.collection import Transitions
from src.training.transition_log import TransitionLog


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
            storage=log,
            sampler=WindowSampler(capacity),
            writer=AppendWriter(),
            collate_fn=_as_is,
            generator=generator,
        )
        self.log, self.generator = log, generator


def sample_minibatches(buffer: Replay, count: int, batch_size: int) -> Batch:
    """The minibatches of a burst of ``count`` updates in one draw: the replay does not change during the burst.

    Observations are as they were observed: not normalised.
    """
    columns = buffer.sample(count * batch_size)
    return Batch(*(column.view(count, batch_size, *column.shape[1:]) for column in columns))


class _Stateless:
    """What TorchRL asks of samplers and writers that could be saved; a run's checkpoint holds length and generator."""

    def state_dict(self) -> dict[str, Any]:
        """Nothing."""
        return {}

    def _ignore(self, *_: Any, **__: Any) -> None:
        """Nothing to load, write, read or forget."""

    load_state_dict = dumps = loads = _empty = _ignore


class WindowSampler(_Stateless, Sampler):
    """Uniform, with replacement, over the last ``capacity`` of L: index ~ U{max(0, L - capacity), ..., L - 1}."""

    def __init__(self, capacity: int) -> None:
        self.capacity = capacity

    def sample(self, storage: Storage, batch_size: int) -> tuple[Tensor, dict]:
        """Indices [batch_size], from the replay's generator."""
        length = len(storage)
        if length == 0:
            raise RuntimeError("the replay is empty")
        return torch.randint(max(0, length - self.capacity), length, (batch_size,), generator=self._rng), {}


class AppendWriter(_Stateless, Writer):
    """Writes behind the last transition; the log's length is its only cursor."""

    @property
    def _write_count(self) -> int:
        return len(self._storage)

    def extend(self, data: Transitions) -> Tensor:  # type: ignore[override]
        """Append transitions [F]; returns their indices [F]."""
        assert isinstance(self._storage, TransitionLog)
        return self._storage.append(data)

    def add(self, data: Transitions) -> int:
        """Append one transition given as a batch of one; returns its index."""
        return int(self.extend(data)[0])


def _as_is(data: Any) -> Any:
    return data
