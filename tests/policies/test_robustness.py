"""If these fail, a policy is said to be robust, or not, against something that was not done to it."""

from __future__ import annotations

import csv
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from src import evaluate
from src.actors.actor import Actor
from src.actors.build import build_actor
from src.config.schema import ConfigurationError
from src.policies import disturbances, robustness
from src.policies.robustness import SEVERITIES, TIME_STEPS, Condition, play_condition
from src.policies.trace import trace, weighted_layers
from src.streams import Streams
from src.training.gym_task import make_gym
from src.training.policy_file import load_policy
from tests.actors.configuration import configuration
from tests.helpers import make_config, tiny
from tests.training.test_session import run

ACTORS = ["popsan", "bptsan", "aan", "popdan", "ilcsan"]


def built(actor: str, **overrides: Any) -> Actor:
    encoder = "task" if actor in ("aan", "popdan", "mdcsan") else "deterministic"
    return build_actor(configuration(actor, encoder, **overrides), 3, 2, Streams(0))


def changes(actor: str, disturb: Callable[[Actor], None]) -> dict[str, tuple[torch.Tensor, torch.Tensor]]:
    """Weights of each layer before and after."""
    network = built(actor)
    before = {layer.name: layer.weight.detach().clone() for layer in weighted_layers(network)}
    disturb(network)
    return {layer.name: (before[layer.name], layer.weight.detach()) for layer in weighted_layers(network)}


@pytest.mark.parametrize("disturbance", [*SEVERITIES, TIME_STEPS])
def test_severity_zero_is_the_plain_evaluation(tiny_run: Path, disturbance: str) -> None:
    path = tiny_run / "policy.pt"
    _, plain = evaluate.play(path, episodes=2, seed=4)
    assert play_condition(path, Condition(disturbance, 0.0), 2, 4).episodes == plain


@pytest.mark.parametrize("disturbance", [*SEVERITIES, TIME_STEPS])
def test_every_disturbance_changes_what_is_played_and_the_same_each_time(tiny_run: Path, disturbance: str) -> None:
    path = tiny_run / "policy.pt"
    severity = SEVERITIES.get(disturbance, (-4.0,))[-1]
    first, again = (play_condition(path, Condition(disturbance, severity), 2, 4).episodes for _ in range(2))
    assert first == again
    assert first != evaluate.play(path, episodes=2, seed=4)[1]


@pytest.mark.parametrize("actor", ACTORS)
def test_weight_noise_has_the_deviation_asked_for_and_grows_with_it(actor: str) -> None:
    small, large = (
        changes(actor, lambda network, s=s: disturbances.add_weight_noise(network, Streams(1), s)) for s in (0.05, 0.1)
    )
    for name, (before, after) in small.items():
        if before.numel() > 1000:
            assert float((after - before).std()) == pytest.approx(0.05, rel=0.1), name
        torch.testing.assert_close(large[name][1] - before, 2 * (after - before), atol=1e-6, rtol=1e-4)


@pytest.mark.parametrize("actor", ACTORS)
def test_the_share_of_zeroed_synapses_is_that_of_every_layer_and_a_larger_one_holds_a_smaller(actor: str) -> None:
    small, large = (
        changes(actor, lambda network, s=s: disturbances.zero_synapses(network, Streams(1), s)) for s in (0.3, 0.6)
    )
    for name, (before, after) in small.items():
        kept = after != 0
        assert torch.equal(after[kept], before[kept]) and bool((large[name][1][~kept] == 0).all())
        if before.numel() > 1000:
            assert float((~kept).float().mean()) == pytest.approx(0.3, abs=0.03), name


@pytest.mark.parametrize("actor", ACTORS)
@pytest.mark.parametrize("bits", [8, 4])
def test_rounded_weights_are_loihis(actor: str, bits: int) -> None:
    """round(w 255 / max|w, b|), and 15 for 255 with 4 bits."""
    network, rounded = built(actor), built(actor)
    disturbances.round_weights(rounded, Streams(0), bits)
    for (name, weight, bias), after in zip(weighted_layers(network), weighted_layers(rounded), strict=True):
        parts = [weight] if bias is None else [weight, bias]
        largest = max(float(part.detach().abs().max()) for part in parts)
        expected = np.round(weight.detach().numpy() * ((2**bits - 1) / largest))
        assert np.abs(expected).max() <= 2**bits - 1
        np.testing.assert_allclose(
            after.weight.detach().numpy() * ((2**bits - 1) / largest), expected, atol=1e-3, err_msg=name
        )


@pytest.mark.parametrize("actor", ACTORS)
def test_dead_neurons_never_fire_and_the_output_population_is_spared(actor: str) -> None:
    network = built(actor)
    observation = torch.randn(200, 3)
    before = trace(network, observation)
    disturbances.silence_neurons(network, Streams(1), 0.4)
    after = trace(network, observation)
    for index, layer in enumerate(after.neurons[:2]):
        active = (layer.activations != 0).any(dim=(0, 1))
        was_active = (before.neurons[index].activations != 0).any(dim=(0, 1))
        dead = torch.rand(256, generator=Streams(1).torch("dead neurons", layer.name)) < 0.4
        assert not active[dead].any() and was_active[dead].any()
    assert all(
        torch.equal(a.bias, b.bias) for a, b in zip(weighted_layers(network)[-1:], weighted_layers(built(actor))[-1:])
    )
    assert (after.raw != before.raw).any()


def test_dynamic_neurons_are_not_said_to_be_silenced() -> None:
    """Their potential is squared, so a low bias makes them fire."""
    with pytest.raises(ConfigurationError, match="how to silence"):
        disturbances.silence_neurons(built("mdcsan"), Streams(1), 0.4)


@pytest.mark.parametrize("env,positions,joints", [("hopper", 5, 3), ("halfcheetah", 8, 6), ("ant_zero_contact", 13, 8)])
def test_the_joints_are_the_actuated_ones(env: str, positions: int, joints: int) -> None:
    environment = make_gym(make_config(env=env).env)
    found = disturbances.joints_of(environment)
    assert found.positions == list(range(positions - joints, positions))
    velocities = {"hopper": 6, "halfcheetah": 9, "ant_zero_contact": 14}[env]
    assert found.velocities == list(range(positions + velocities - joints, positions + velocities))


def test_one_joint_is_replaced_for_a_whole_episode_and_noise_reaches_all() -> None:
    one = disturbances.replaced(np.random.default_rng(0), [2, 3, 4], 10.0)
    seen = np.array([one(np.zeros(6)) for _ in range(500)])
    (place,) = np.flatnonzero(seen.any(axis=0))
    assert place in (2, 3, 4) and seen[:, place].std() == pytest.approx(10.0, rel=0.15)
    noise = np.array([disturbances.noisy(np.random.default_rng(k), 0.1)(np.ones(6)) for k in range(500)])
    np.testing.assert_allclose(noise.std(axis=0), 0.1, rtol=0.15)
    np.testing.assert_allclose(noise.mean(axis=0), 1.0, atol=0.02)


def test_more_time_steps_are_played_with_the_same_weights(tiny_run: Path) -> None:
    trained = load_policy(tiny_run / "policy.pt")
    weights = {name: value.clone() for name, value in trained.policy.actor.state_dict().items()}
    robustness._change_time_steps(trained, 5)
    assert trained.policy.actor.encoder.time_steps == 10
    assert all(torch.equal(value, weights[name]) for name, value in trained.policy.actor.state_dict().items())


def test_the_command_writes_every_condition_and_the_same_bytes_again(
    tiny_run: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(robustness, "SEVERITIES", {"weight noise": (0.05,), "joint velocity": (10.0,)})
    command = [str(tiny_run), "--robustness", "--episodes", "2", "--seed", "4"]
    assert evaluate.main(command) == 0
    path = tiny_run / "robustness.csv"
    first = path.read_bytes()
    assert evaluate.main(command) == 0 and path.read_bytes() == first
    rows = list(csv.DictReader(path.open()))
    assert {(row["disturbance"], row["severity"]) for row in rows} == {
        ("none", "0"),
        ("weight noise", "0.05"),
        ("joint velocity", "10"),
        ("time steps", "-3"),
        ("time steps", "-1"),
        ("time steps", "5"),
    }
    _, plain = evaluate.play(tiny_run / "policy.pt", episodes=2, seed=4)
    assert [float(row["return"]) for row in rows[:2]] == [episode_return for episode_return, _ in plain]


def test_an_unknown_disturbance_is_refused(tiny_run: Path) -> None:
    with pytest.raises(ConfigurationError, match="no disturbance"):
        play_condition(tiny_run / "policy.pt", Condition("gravity", 1.0), 1, 0)


def test_an_extended_run_keeps_no_robustness_of_its_former_policy(tmp_path: Path) -> None:
    short = {"keep_replay": True, "protocol.total_steps": 300}
    path = run(tiny(tmp_path, short, actor="aan"))[1]
    (path / "robustness.csv").write_text("of the policy of step 300")
    outcome, extended = run(tiny(tmp_path, short | {"protocol.total_steps": 450}, actor="aan"))
    assert (outcome.step, extended) == (450, path) and not (path / "robustness.csv").exists()
