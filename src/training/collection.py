"""Collecting experience: TorchRL's Collector, set up for one environment and a policy that is a plain function."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import torch
from tensordict import TensorDictBase
from torch import Tensor
from torchrl.collectors import Collector
from torchrl.data import Composite

from src.training.environment import TrainingEnvironment

Policy = Callable[[Tensor], Tensor]


class Transitions(NamedTuple):
    """A batch of F consecutive environment steps. All tensors are float32 and the batch's own copy."""

    observation: Tensor  # [F, N]
    action: Tensor  # [F, M]
    reward: Tensor  # [F]
    next_observation: Tensor  # [F, N]; at the end of an episode its own last observation
    terminated: Tensor  # [F], 0 or 1: the task ended the episode (no bootstrapping)
    truncated: Tensor  # [F], 0 or 1: the time limit ended it (bootstrapped through)
    finished: list[tuple[float, int]]  # (return, length) of each episode that ended, in order; returns in float64


class _CollectorPolicy:
    """``observation [N] -> action [M]`` as the Collector wants it: reads and writes the step's tensordict.

    The spec, and no ``out_keys``, keeps the Collector from calling the policy once at construction to find out what it
    writes, which would move the exploration stream.
    """

    def __init__(self, policy: Policy, environment: TrainingEnvironment) -> None:
        self._policy = policy
        self.spec = Composite(action=environment.action_spec.clone())

    def __call__(self, tensordict: TensorDictBase) -> TensorDictBase:
        tensordict.set("action", self._policy(tensordict.get("observation")))
        return tensordict


def make_collector(environment: TrainingEnvironment, policy: Policy, frames_per_batch: int) -> Collector:
    """An endless collector of batches of ``frames_per_batch`` steps, on the CPU.

    Its constructor resets the environment once (one that was given a saved state goes on from it) and does not
    call the policy. Batches come in one buffer that the next batch overwrites: read each with :func:`transitions`.

    Args:
        environment: seeded, or given a saved state.
        policy: observation float32 [N] -> action float32 [M], called once a step without gradients.
        frames_per_batch: F, steps in a batch.
    """
    return Collector(
        environment,
        _CollectorPolicy(policy, environment),
        frames_per_batch=frames_per_batch,
        total_frames=-1,
        device="cpu",
        trust_policy=True,
        track_traj_ids=False,
        auto_register_policy_transforms=False,
        no_cuda_sync=True,
        use_buffers=True,
        return_same_td=True,
    )


def transitions(batch: TensorDictBase) -> Transitions:
    """The Collector's batch [F] as :class:`Transitions`."""
    outcome = batch.get("next")
    done = outcome.get("done")[:, 0]
    finished = outcome.get("episode")[done]
    return Transitions(
        observation=batch.get("observation").clone(),
        action=batch.get("action").clone(),
        reward=outcome.get("reward")[:, 0].clone(),
        next_observation=outcome.get("observation").clone(),
        terminated=outcome.get("terminated")[:, 0].to(torch.float32),
        truncated=outcome.get("truncated")[:, 0].to(torch.float32),
        finished=[(float(episode_return), int(length)) for episode_return, length in finished.tolist()],
    )
