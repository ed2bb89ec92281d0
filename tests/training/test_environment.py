"""TorchRL and Gymnasium must agree on what happened; a task that cannot be trained must be said so in a sentence."""

from __future__ import annotations

import subprocess
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest
import torch
from torchrl.envs import EnvBase
from torchrl.envs.utils import check_env_specs

from src.config.schema import ConfigurationError, EnvConfig
from src.training.environment import TrainingEnvironment
from src.training.gym_task import make_gym, sizes
from tests.helpers import ROOT
from tests.training.tasks import TASKS, task

SIZES = {
    "hopper": (11, 3),
    "walker2d": (17, 6),
    "halfcheetah": (17, 6),
    "ant": (111, 8),
    "ant_zero_contact": (111, 8),
    "ant_no_contact": (27, 8),
    "hopper_v5": (11, 3),
    "walker2d_v5": (17, 6),
    "halfcheetah_v5": (17, 6),
    "ant_v5": (105, 8),
    "inverted_double_pendulum": (11, 1),
    "humanoid": (376, 17),
}


def other(id: str, **kwargs: object) -> EnvConfig:
    return EnvConfig(
        name="x", id=id, kwargs=kwargs, zero_padding=0, max_episode_steps=100, spike_coding="deterministic"
    )


@pytest.mark.parametrize("name", TASKS)
def test_sizes_are_the_papers(name: str) -> None:
    assert sizes(task(name)) == SIZES[name]
    environment = TrainingEnvironment(task(name), seed=0)
    limit = 0.4 if name == "humanoid" else 1.0
    assert (environment.observation_size, environment.action_size) == SIZES[name]
    assert environment.action_limit == pytest.approx(limit)


def test_zero_padding_appends_zeros_to_the_plain_task() -> None:
    padded, plain = make_gym(task("ant_zero_contact")), make_gym(task("ant_no_contact"))
    np.testing.assert_array_equal(padded.reset(seed=3)[0], np.append(plain.reset(seed=3)[0], np.zeros(84)))
    action = np.full(8, 0.3, np.float32)
    (found, reward, *_), (expected, plain_reward, *_) = padded.step(action), plain.step(action)
    np.testing.assert_array_equal(found, np.append(expected, np.zeros(84)))
    assert reward == plain_reward


@pytest.mark.parametrize("name", ["hopper", "halfcheetah", "ant", "ant_v5", "inverted_double_pendulum", "humanoid"])
def test_the_steps_are_gymnasiums(name: str) -> None:
    """Also where episodes end: the last observation is the episode's own, the next is a reset's."""
    config = task(name, max_episode_steps=60)
    plain, environment = make_gym(config), TrainingEnvironment(config, seed=4)
    actions = torch.rand(150, environment.action_size, generator=torch.Generator().manual_seed(0)) * 2 - 1
    observation, total, length, ends = plain.reset(seed=4)[0], 0.0, 0, 0
    state = environment.reset()
    for action in actions:
        np.testing.assert_array_equal(state["observation"].numpy(), observation.astype(np.float32))
        observation, reward, terminated, truncated, _ = plain.step(action.numpy())
        total, length = total + float(reward), length + 1
        state["action"] = action
        step, state = environment.step_and_maybe_reset(state)
        outcome = step["next"]
        np.testing.assert_array_equal(outcome["observation"].numpy(), observation.astype(np.float32))
        assert outcome["reward"].item() == np.float32(reward)
        assert (outcome["terminated"].item(), outcome["truncated"].item()) == (terminated, truncated)
        assert outcome["done"].item() == (terminated or truncated)
        assert outcome["episode"].tolist() == [total, length]
        assert not state["done"].item() and "next" not in state
        if terminated or truncated:
            observation, total, length, ends = plain.reset()[0], 0.0, 0, ends + 1
    assert ends >= 2


def test_the_short_cut_is_torchrls_own_step() -> None:
    """step_and_maybe_reset skips EnvBase's bookkeeping; it must not skip anything that is seen."""
    short, full = (TrainingEnvironment(task("hopper", max_episode_steps=20), seed=1) for _ in range(2))
    here, there = short.reset(), full.reset()
    for action in torch.rand(60, 3, generator=torch.Generator().manual_seed(0)) * 2 - 1:
        here["action"] = there["action"] = action
        step, here = short.step_and_maybe_reset(here)
        expected, there = EnvBase.step_and_maybe_reset(full, there)
        assert (step == expected).all() and set(step.keys(True)) == set(expected.keys(True))
        assert (here == there.exclude("action")).all() and set(here.keys(True)) == set(there.keys(True)) - {"action"}


@pytest.mark.parametrize("name", ["hopper", "ant_zero_contact"])
def test_it_is_what_its_specs_say(name: str) -> None:
    environment = TrainingEnvironment(task(name), seed=0)
    check_env_specs(environment, seed=0)


def test_the_seed_decides_the_episodes() -> None:
    first, same, different = (TrainingEnvironment(task("hopper"), seed=s) for s in (0, 0, 1))
    starts = [environment.reset()["observation"] for environment in (first, same, different)]
    assert torch.equal(starts[0], starts[1]) and not torch.equal(starts[0], starts[2])
    assert torch.equal(first.reset()["observation"], same.reset()["observation"])
    different.set_seed(0)
    assert torch.equal(different.reset()["observation"], starts[0])


@pytest.mark.parametrize(
    "config, sentence",
    [
        (other("Hoper-v4"), r"^env\.id: Gymnasium has no task Hoper-v4"),
        (other("Hopper-v3"), r"^env\.id: .*Hopper-v3"),
        (other("nowhere/Hopper-v4"), r"^env\.id: .*nowhere"),
        (other("Hopper-v4", wings=2), r"^env\.kwargs: Hopper-v4 does not take"),
        (other("CartPole-v1"), r"^env\.id: CartPole-v1 acts in Discrete"),
        (other("Blackjack-v1"), r"^env\.id: Blackjack-v1 observes"),
    ],
)
def test_a_task_that_cannot_be_made_is_one_sentence(config: EnvConfig, sentence: str) -> None:
    with pytest.raises(ConfigurationError, match=sentence):
        sizes(config)


def test_a_task_whose_state_cannot_be_saved_is_refused_at_once() -> None:
    with pytest.raises(ConfigurationError, match="no MuJoCo task"):
        TrainingEnvironment(other("Pendulum-v1"))


_NO_MUJOCO = """
import sys
sys.modules["mujoco"] = None
from src.config.schema import ConfigurationError, EnvConfig
from src.training.gym_task import sizes
try:
    sizes(EnvConfig(name="x", id="Hopper-v4", kwargs={}, zero_padding=0, max_episode_steps=9, spike_coding="poisson"))
except ConfigurationError as error:
    print(error)
"""


def test_without_mujoco_it_says_so() -> None:
    result = subprocess.run(
        [sys.executable, "-c", _NO_MUJOCO], capture_output=True, text=True, cwd=ROOT, timeout=120, check=True
    )
    assert result.stdout.startswith("env.id: Hopper-v4 needs a package that is not installed")


_UNSTABLE = """
import sys
sys.path.insert(0, sys.argv[1])
import numpy as np
from src.config.schema import EnvConfig
from src.training.gym_task import make_gym
assert "torch" not in sys.modules
environment = make_gym(EnvConfig(name="x", id="HalfCheetah-v4", kwargs={}, zero_padding=0, max_episode_steps=10,
                                 spike_coding="poisson"))
environment.reset(seed=0)
environment.unwrapped.data.qpos[:] = np.nan
environment.step(np.zeros(6, np.float32))
"""


def test_the_users_folder_and_terminal_stay_clean(tmp_path: Path) -> None:
    """No MUJOCO_LOG.TXT, no notes about v4 and HalfCheetah's model file; but a real warning is still seen."""
    command = [sys.executable, "-W", "always", "-c", _UNSTABLE, str(ROOT)]
    result = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, timeout=120, check=True)
    assert list(tmp_path.iterdir()) == []
    assert "out of date" not in result.stderr and "settotalmass" not in result.stderr
    assert "simulation is unstable" in result.stderr


def test_other_warnings_of_gymnasium_are_left_alone() -> None:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        make_gym(task("hopper"))
        warnings.warn("another thing", DeprecationWarning, stacklevel=1)
    assert [str(w.message) for w in caught] == ["another thing"]
