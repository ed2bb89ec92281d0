"""An evaluation must measure the policy and nothing else, and leave the training where it was."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
import torch

from src.streams import Streams
from src.training.evaluation import Evaluator
from src.training.gym_task import make_gym
from tests.helpers import ROOT
from tests.training.tasks import task


def evaluator(name: str = "hopper", episodes: int = 4, seed: int = 0, limit: int = 80) -> Evaluator:
    return Evaluator(task(name, max_episode_steps=limit), episodes, Streams(seed))


def act(observations: torch.Tensor, generator: torch.Generator) -> torch.Tensor:
    """Depends on the observation, and draws as a Poisson encoder does."""
    noise = torch.rand(len(observations), 3, generator=generator)
    return torch.tanh(observations[:, :3] + noise - 0.5)


def test_returns_are_those_of_episodes_played_alone() -> None:
    """Side by side or one after the other: a policy without chance gets the same returns, in float64."""
    policy = lambda observations, _: torch.sin(100 * observations[:, 5:8])  # noqa: E731
    found = evaluator(episodes=5).evaluate(policy, step=1000)
    assert len({length for _, length in found}) > 1, "episodes should end at different times"
    environment = make_gym(task("hopper", max_episode_steps=80))
    for episode, (expected_return, expected_length) in enumerate(found):
        observation = environment.reset(seed=Streams(0).integer("evaluation", 1000, episode))[0]
        total, length, ended = 0.0, 0, False
        while not ended:
            action = policy(torch.from_numpy(observation.astype(np.float32))[None], None)[0].numpy()
            observation, reward, terminated, truncated, _ = environment.step(action)
            total, length, ended = total + float(reward), length + 1, terminated or truncated
        assert (total, length) == (expected_return, expected_length)


def test_one_call_for_all_that_still_run() -> None:
    sizes: list[int] = []

    def counting(observations: torch.Tensor, generator: torch.Generator) -> torch.Tensor:
        assert observations.dtype == torch.float32 and not torch.is_grad_enabled()
        sizes.append(len(observations))
        return act(observations, generator)

    results = evaluator(episodes=6).evaluate(counting, step=0)
    lengths = [length for _, length in results]
    assert len(sizes) == max(lengths)
    assert sizes == [sum(length > t for length in lengths) for t in range(max(lengths))]


def test_an_evaluation_does_not_depend_on_those_before() -> None:
    used = evaluator()
    for step in (0, 500):
        used.evaluate(act, step)
    assert used.evaluate(act, 1000) == evaluator().evaluate(act, 1000)


def test_steps_and_seeds_give_other_episodes() -> None:
    first = evaluator().evaluate(act, 1000)
    assert len(set(first)) == len(first)
    assert first != evaluator().evaluate(act, 2000)
    assert first != evaluator(seed=1).evaluate(act, 1000)


def test_more_episodes_leave_the_first_ones_alone() -> None:
    policy = lambda observations, _: torch.sin(100 * observations[:, 5:8])  # noqa: E731
    assert evaluator(episodes=5).evaluate(policy, 7)[:2] == evaluator(episodes=2).evaluate(policy, 7)


def test_it_moves_no_stream_of_the_training() -> None:
    before = torch.get_rng_state(), np.random.get_state()[1].copy()
    evaluator().evaluate(act, 0)
    assert torch.equal(before[0], torch.get_rng_state())
    assert np.array_equal(before[1], np.random.get_state()[1])


_FRESH = """
from tests.training.test_evaluation import act, evaluator
print(evaluator().evaluate(act, 1000))
"""


def test_a_fresh_process_gives_the_same_numbers() -> None:
    used = evaluator()
    used.evaluate(act, 0)
    result = subprocess.run(
        [sys.executable, "-c", _FRESH], capture_output=True, text=True, cwd=ROOT, timeout=120, check=True
    )
    assert result.stdout.strip() == repr(used.evaluate(act, 1000))


@pytest.mark.parametrize("name, limit", [("halfcheetah", 30), ("ant_zero_contact", 30)])
def test_time_limit_and_padding_hold_here_too(name: str, limit: int) -> None:
    size = {"halfcheetah": 6, "ant_zero_contact": 8}[name]
    results = evaluator(name, episodes=2, limit=limit).evaluate(lambda o, _: torch.zeros(len(o), size), 0)
    assert [length for _, length in results] == [limit, limit]
