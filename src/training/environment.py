"""The training environment: one Gymnasium task for TorchRL's Collector, thin, fast, and saved in mid-episode.

TorchRL's ``GymEnv`` costs more per step than most of the simulators here. This one does what the Collector needs
and nothing else, and it makes an exact resume possible without any private part of the Collector: its next ``reset()``
can hand back a saved state (see :meth:`TrainingEnvironment.restore_on_next_reset`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from tensordict import TensorDict, TensorDictBase
from torchrl.data import Binary, Bounded, Composite, Unbounded
from torchrl.envs import EnvBase

from src.config.schema import EnvConfig
from src.training import simulator_state
from src.training.checkpoint import CorruptState
from src.training.gym_task import box, make_gym

_CPU = torch.device("cpu")
_NO_BATCH = torch.Size([])
_FALSE = torch.zeros(1, dtype=torch.bool)
_TRUE = torch.ones(1, dtype=torch.bool)
_RUNNING = {"done": _FALSE, "terminated": _FALSE, "truncated": _FALSE}


@dataclass(slots=True)
class _Episode:
    """What the environment knows of the running episode (a plain object: ``EnvBase`` is slow to set attributes on)."""

    observation: torch.Tensor  # float32 [N], the last one
    episode_return: float  # in float64
    length: int
    ended: bool


class TrainingEnvironment(EnvBase):
    """A TorchRL environment over :func:`make_gym`, on the CPU, without a batch dimension.

    Keys: ``observation`` float32 [N], ``action`` float32 [M], ``reward`` float32 [1], ``terminated``, ``truncated``,
    ``done`` bool [1], ``episode`` float64 [2]: the return and the length of the episode so far, this step included.
    At the end of an episode ``("next", "observation")`` is the episode's own last observation.

    Args:
        config: the task.
        seed: seeds the next ``reset()``; the episodes after it follow from the task's own generator.

    Raises:
        ConfigurationError: as :func:`make_gym`.
    """

    def __init__(self, config: EnvConfig, seed: int | None = None) -> None:
        super().__init__(device=_CPU, batch_size=_NO_BATCH)
        self._gym = make_gym(config)
        self.is_closed = False
        actions = box(self._gym.action_space)
        self.observation_size, self.action_size = box(self._gym.observation_space).shape[0], actions.shape[0]
        self.action_limit = float(actions.high[0])
        self._declare_specs()
        self._next_seed = seed
        self._pending_state: dict[str, Any] | None = None
        self._episode = _Episode(torch.zeros(self.observation_size), 0.0, 0, False)

    def _declare_specs(self) -> None:
        flag = Binary(1, dtype=torch.bool, shape=(1,))
        self.observation_spec = Composite(
            observation=Unbounded((self.observation_size,)), episode=Unbounded((2,), dtype=torch.float64)
        )
        self.action_spec = Bounded(-self.action_limit, self.action_limit, (self.action_size,), dtype=torch.float32)
        self.reward_spec = Unbounded((1,))
        self.full_done_spec = Composite(done=flag, terminated=flag.clone(), truncated=flag.clone())

    def _set_seed(self, seed: int | None) -> None:
        self._next_seed = seed

    def save_state(self) -> dict[str, Any]:
        """The environment between two steps: tensors, numbers and strings (``torch.load(weights_only=True)``)."""
        state = simulator_state.capture(self._gym)
        state["observation"] = self._episode.observation.clone()
        state["episode_return"] = self._episode.episode_return
        state["episode_length"] = self._episode.length
        return state

    def restore_on_next_reset(self, state: dict[str, Any]) -> None:
        """The next ``reset()``, instead of starting an episode, goes on from ``state`` (of :meth:`save_state`).

        Whatever seed was set is forgotten then: the task's generator is part of the state.
        """
        self._pending_state = state

    def _reset(self, tensordict: TensorDictBase | None = None, **kwargs: Any) -> TensorDictBase:
        if self._pending_state is not None:
            self._episode = self._resumed(self._pending_state)
        else:
            observation, _ = self._gym.reset(seed=self._next_seed)
            self._episode = _Episode(torch.from_numpy(np.asarray(observation, np.float32)), 0.0, 0, False)
        self._pending_state = self._next_seed = None
        return self._before_step()

    def _resumed(self, state: dict[str, Any]) -> _Episode:
        simulator_state.restore(self._gym, state)
        try:
            observation = state["observation"].clone()
            if observation.shape != (self.observation_size,) or observation.dtype != torch.float32:
                raise ValueError(f"observation has shape {tuple(observation.shape)} and type {observation.dtype}")
            return _Episode(observation, float(state["episode_return"]), int(state["episode_length"]), False)
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise CorruptState(f"the saved environment does not fit the task: {error!r}") from error

    def _progress(self) -> torch.Tensor:
        return torch.from_numpy(np.array((self._episode.episode_return, self._episode.length), np.float64))

    def _before_step(self) -> TensorDict:
        content = {"observation": self._episode.observation, "episode": self._progress(), **_RUNNING}
        return TensorDict._new_unsafe(content, _NO_BATCH, device=_CPU)

    def _step(self, tensordict: TensorDictBase) -> TensorDictBase:
        episode = self._episode
        observation, reward, terminated, truncated, _ = self._gym.step(tensordict.get("action").numpy())
        episode.observation = torch.from_numpy(np.asarray(observation, np.float32))
        episode.episode_return += float(reward)
        episode.length += 1
        episode.ended = bool(terminated or truncated)
        content = {
            "observation": episode.observation,
            "episode": self._progress(),
            "reward": torch.from_numpy(np.array((reward,), np.float32)),
            "terminated": _TRUE if terminated else _FALSE,
            "truncated": _TRUE if truncated else _FALSE,
            "done": _TRUE if episode.ended else _FALSE,
        }
        return TensorDict._new_unsafe(content, _NO_BATCH, device=_CPU)

    def step_and_maybe_reset(self, tensordict: TensorDictBase) -> tuple[TensorDictBase, TensorDictBase]:
        """One step, and a new episode where one ended: what the Collector calls.

        The same as ``EnvBase``'s, without its checks, copies and bookkeeping for batches of environments.
        """
        tensordict.set("next", self._step(tensordict))
        return tensordict, self._reset() if self._episode.ended else self._before_step()

    def close(self, *, raise_if_closed: bool = True) -> None:
        """Release the simulator."""
        if not self.is_closed:
            self._gym.close()
        super().close(raise_if_closed=raise_if_closed)
