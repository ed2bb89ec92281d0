"""What the loop trains on must be what happened, in order, each step once, however it is cut into batches."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from src.training.collection import make_collector, transitions
from src.training.environment import TrainingEnvironment
from src.training.gym_task import make_gym
from tests.training.tasks import assert_same, random_policy, task


@pytest.mark.parametrize("name", ["hopper", "halfcheetah", "ant"])
def test_batches_are_gymnasiums_steps(name: str) -> None:
    """Every field, over terminations and truncations, against the plain environment driven by hand."""
    config = task(name, max_episode_steps=45)
    plain, environment = make_gym(config), TrainingEnvironment(config, seed=7)
    policy = random_policy(environment.action_size, torch.Generator().manual_seed(1))
    collector = iter(make_collector(environment, policy, 50))
    observation, total, length, truncations = plain.reset(seed=7)[0], 0.0, 0, 0
    for _ in range(4):
        batch, finished = transitions(next(collector)), []
        assert all(tensor.dtype == torch.float32 and tensor.is_contiguous() for tensor in batch[:-1])
        for i in range(50):
            assert np.array_equal(batch.observation[i].numpy(), observation.astype(np.float32))
            observation, reward, terminated, truncated, _ = plain.step(batch.action[i].numpy())
            total, length = total + float(reward), length + 1
            assert np.array_equal(batch.next_observation[i].numpy(), observation.astype(np.float32))
            assert batch.reward[i].item() == np.float32(reward)
            assert (batch.terminated[i].item(), batch.truncated[i].item()) == (float(terminated), float(truncated))
            truncations += truncated
            if terminated or truncated:
                finished.append((total, length))
                observation, total, length = plain.reset()[0], 0.0, 0
        assert batch.finished == finished
    assert truncations or name == "hopper"


def test_an_episode_truncated_at_a_batchs_edge() -> None:
    """The batch ends with the episode's own last observation; the next one begins with the reset's."""
    config = task("halfcheetah", max_episode_steps=50)
    environment = TrainingEnvironment(config, seed=0)
    collector = iter(make_collector(environment, lambda _: torch.ones(6), 50))
    first, second = transitions(next(collector)), transitions(next(collector))
    assert first.truncated.tolist() == [0.0] * 49 + [1.0] and first.terminated.sum() == 0
    assert len(first.finished) == 1 and first.finished[0][1] == 50
    assert (first.next_observation[-1] - second.observation[0]).abs().max() > 0.5


def test_the_policy_is_called_once_a_step_and_not_before() -> None:
    """An extra call at construction would move the exploration stream, and a resumed run away from its twin."""
    seen: list[torch.Tensor] = []

    def policy(observation: torch.Tensor) -> torch.Tensor:
        assert observation.shape == (11,) and observation.dtype == torch.float32 and not torch.is_grad_enabled()
        seen.append(observation.clone())
        return torch.zeros(3)

    collector = iter(make_collector(TrainingEnvironment(task("hopper"), seed=0), policy, 20))
    assert seen == []
    batch = transitions(next(collector))
    assert torch.equal(torch.stack(seen), batch.observation)


def test_a_batch_survives_the_next_one() -> None:
    """The collector overwrites its buffer."""
    environment = TrainingEnvironment(task("hopper"), seed=0)
    collector = iter(make_collector(environment, random_policy(3, torch.Generator()), 10))
    first = transitions(next(collector))
    copy = type(first)(*(tensor.clone() for tensor in first[:-1]), list(first.finished))
    next(collector)
    assert_same(first, copy)


def test_collecting_leaves_the_global_generators_alone() -> None:
    """Each source of chance has its own stream."""
    environment = TrainingEnvironment(task("hopper"), seed=0)
    before = torch.get_rng_state(), np.random.get_state()[1].copy()
    collector = iter(make_collector(environment, random_policy(3, torch.Generator()), 50))
    for _ in range(3):
        next(collector)
    assert torch.equal(before[0], torch.get_rng_state())
    assert np.array_equal(before[1], np.random.get_state()[1])


def test_the_size_of_batches_changes_nothing() -> None:
    fields = []
    for frames in (10, 60):
        policy = random_policy(3, torch.Generator().manual_seed(2))
        collector = iter(make_collector(TrainingEnvironment(task("hopper"), seed=0), policy, frames))
        batches = [transitions(next(collector)) for _ in range(60 // frames)]
        fields.append([torch.cat(parts) for parts in zip(*(batch[:-1] for batch in batches))])
    assert all(torch.equal(left, right) for left, right in zip(*fields))
