"""A run stopped in mid-episode must see, after its resume, the very steps that it would have seen."""

from __future__ import annotations

import io
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from tensordict import TensorDictBase

from src.config.schema import EnvConfig
from src.training import simulator_state
from src.training.checkpoint import CorruptState
from src.training.collection import Transitions, make_collector, transitions
from src.training.environment import TrainingEnvironment
from src.training.gym_task import make_gym
from tests.helpers import ROOT
from tests.training.tasks import TASKS, assert_same, random_policy, task

FRAMES, BATCHES, SAVE_AFTER = 50, 8, (1, 3, 6)


def config_of(name: str) -> EnvConfig:
    return task(name, max_episode_steps=137)


def through_a_file(state: dict[str, Any]) -> dict[str, Any]:
    buffer = io.BytesIO()
    torch.save(state, buffer)
    buffer.seek(0)
    return torch.load(buffer, weights_only=True)


def play(name: str) -> tuple[list[Transitions], dict[int, dict[str, Any]]]:
    """The run never stopped, and what its checkpoints after each of SAVE_AFTER batches hold."""
    environment = TrainingEnvironment(config_of(name), seed=11)
    generator = torch.Generator().manual_seed(5)
    collector = iter(make_collector(environment, random_policy(environment.action_size, generator), FRAMES))
    batches, saved = [], {}
    for number in range(1, BATCHES + 1):
        batches.append(transitions(next(collector)))
        if number in SAVE_AFTER:
            saved[number] = through_a_file({"environment": environment.save_state(), "policy": generator.get_state()})
    return batches, saved


def resume(name: str, saved: dict[str, Any], batches: int) -> list[Transitions]:
    environment = TrainingEnvironment(config_of(name), seed=99)
    environment.restore_on_next_reset(saved["environment"])
    generator = torch.Generator()
    generator.set_state(saved["policy"])
    collector = iter(make_collector(environment, random_policy(environment.action_size, generator), FRAMES))
    return [transitions(next(collector)) for _ in range(batches)]


@pytest.mark.parametrize("name", TASKS)
def test_a_restored_environment_continues_bit_for_bit(name: str) -> None:
    batches, saved = play(name)
    assert sum(len(batch.finished) for batch in batches[SAVE_AFTER[0] :]) >= 2, "no episode ends after the resume"
    for number in SAVE_AFTER:
        for expected, found in zip(batches[number:], resume(name, saved[number], BATCHES - number), strict=True):
            assert_same(expected, found)


def steps(environment: TrainingEnvironment, before: TensorDictBase, actions: torch.Tensor) -> Iterator[TensorDictBase]:
    """``next`` of each step."""
    for action in actions:
        step, before = environment.step_and_maybe_reset(before.set("action", action))
        yield step["next"]


def test_ant_in_contact_continues_bit_for_bit() -> None:
    """Its reward reads positions that lag, its observation contact forces that are stale until the next step."""
    actions = torch.rand(260, 8, generator=torch.Generator().manual_seed(0)) * 2 - 1
    environment = TrainingEnvironment(task("ant"), seed=2)
    expected, saved = [], {}
    for number, outcome in enumerate(steps(environment, environment.reset(), actions), start=1):
        expected.append(outcome)
        in_contact = bool(outcome["observation"][27:].abs().max() > 0)
        if in_contact and number > 20 * len(saved) and number < 200 and not outcome["done"].item():
            saved[number] = through_a_file(environment.save_state())
    assert len(saved) >= 5
    for number, state in saved.items():
        resumed = TrainingEnvironment(task("ant"))
        resumed.restore_on_next_reset(state)
        for found, other in zip(steps(resumed, resumed.reset(), actions[number:]), expected[number:], strict=True):
            assert bool((found == other).all())


def test_the_physics_alone_would_not_do() -> None:
    """What is saved beyond MuJoCo's own state is needed: without xpos Ant's first reward is wrong."""
    environment, other = make_gym(task("ant")), make_gym(task("ant"))
    environment.reset(seed=0)
    for _ in range(20):
        environment.step(np.full(8, 0.7, np.float32))
    state = simulator_state.capture(environment)
    state["xpos"] = state["xpos"] * 0
    simulator_state.restore(other, state)
    action = np.zeros(8, np.float32)
    assert environment.step(action)[1] != other.step(action)[1]


def test_saving_changes_nothing() -> None:
    batches, _ = play("ant")
    environment = TrainingEnvironment(config_of("ant"), seed=11)
    policy = random_policy(8, torch.Generator().manual_seed(5))
    collector = iter(make_collector(environment, policy, FRAMES))
    for expected in batches:
        assert_same(expected, transitions(next(collector)))


@pytest.mark.parametrize("name", ["halfcheetah", "ant"])
def test_a_save_where_an_episode_has_just_ended(name: str) -> None:
    """The collector has then already begun the next one: its first observation is what must come back."""
    config = task(name, max_episode_steps=25)  # ends with every batch
    runs = []
    for stop in (False, True):
        environment = TrainingEnvironment(config, seed=3)
        generator = torch.Generator().manual_seed(0)
        policy = random_policy(environment.action_size, generator)
        batches, collector = [], iter(make_collector(environment, policy, 25))
        for _ in range(4):
            batches.append(transitions(next(collector)))
            if stop:
                state = through_a_file(environment.save_state())
                environment = TrainingEnvironment(config)
                environment.restore_on_next_reset(state)
                collector = iter(make_collector(environment, policy, 25))
        runs.append(batches)
    assert all(len(batch.finished) == 1 for batch in runs[0])
    for expected, found in zip(*runs, strict=True):
        assert_same(expected, found)


_CONTINUE = """
import sys, torch
from tests.training.test_simulator_state import resume
saved = torch.load(sys.argv[1], weights_only=True)
torch.save({n: [tuple(b[:-1]) + (b.finished,) for b in resume(n, s, 2)] for n, s in saved.items()}, sys.argv[2])
"""


def test_a_fresh_process_continues_bit_for_bit(tmp_path: Path) -> None:
    runs = {name: play(name) for name in ("hopper", "halfcheetah", "ant")}
    torch.save({name: saved[3] for name, (_, saved) in runs.items()}, tmp_path / "saved.pt")
    command = [sys.executable, "-c", _CONTINUE, str(tmp_path / "saved.pt"), str(tmp_path / "found.pt")]
    subprocess.run(command, check=True, cwd=ROOT, timeout=120)
    found = torch.load(tmp_path / "found.pt", weights_only=True)
    for name, (batches, _) in runs.items():
        for expected, continued in zip(batches[3:5], found[name], strict=True):
            assert_same(expected, Transitions(*continued))


def test_a_state_of_another_task_is_refused() -> None:
    ant = make_gym(task("ant"))
    ant.reset(seed=0)
    with pytest.raises(CorruptState, match="does not fit the task"):
        simulator_state.restore(make_gym(task("hopper")), simulator_state.capture(ant))


@pytest.mark.parametrize("missing", ["physics", "xpos", "random", "elapsed_steps"])
def test_an_incomplete_state_is_refused(missing: str) -> None:
    hopper = make_gym(task("hopper"))
    hopper.reset(seed=0)
    state = simulator_state.capture(hopper)
    del state[missing]
    with pytest.raises(CorruptState):
        simulator_state.restore(hopper, state)


def test_a_checkpoint_needs_no_unpickling_of_classes() -> None:
    """weights_only loading is what keeps a stranger's file harmless; it takes tensors, numbers and strings."""
    environment = TrainingEnvironment(task("hopper"), seed=0)
    environment.reset()
    state = environment.save_state()
    assert {type(value) for value in state.values()} <= {torch.Tensor, int, float, str}
    assert through_a_file(state).keys() == state.keys()
