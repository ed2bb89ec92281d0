"""Whole actors: the four spiking ones as one class, the step-by-step version, the interface that training builds on."""

from __future__ import annotations

import copy
import pickle

import pytest
import torch
from torch import nn

from benchmarks.stepwise import StepwiseSpikingActor
from src.actors.actor import Actor
from src.actors.build import build_actor
from src.actors.mlp import MLPActor
from src.actors.spiking_actor import SpikingActor
from src.config.schema import ConfigurationError
from src.streams import Streams
from tests.actors.configuration import configuration

SPIKING = ["popsan", "bptsan", "bptsan_wo_ndt", "bptsan_wo_li"]
SMALL = {"actor__hidden_sizes": [32, 24]}


def build(actor="bptsan", encoder="deterministic", seed=0, **overrides):
    return build_actor(configuration(actor, encoder, **(SMALL | overrides)), 11, 3, Streams(seed))


def stepwise(actor):
    """The same actor with one product a layer, branch and step."""
    twin = copy.deepcopy(actor)
    twin.__class__ = StepwiseSpikingActor
    return twin


def observations(batch=20, seed=0):
    return torch.randn(batch, 11, generator=torch.Generator().manual_seed(seed))


def stream(seed=0):
    return torch.Generator().manual_seed(seed)


def train(actor, steps=5):
    """A few Adam steps; the raw actions and gradients on the way."""
    optimizer = torch.optim.Adam(actor.parameters(), lr=1e-3)
    trace = []
    for step in range(steps):
        raw = actor(observations(seed=step), stream(step))
        optimizer.zero_grad()
        (raw - 1).square().sum().backward()
        trace += [raw.detach()] + [parameter.grad.clone() for parameter in actor.parameters()]
        optimizer.step()
        actor.project()
    return trace


@pytest.mark.parametrize("encoder", ["deterministic", "poisson"])
def test_bptsan_without_both_topologies_is_popsan(encoder):
    """Bit for bit: forward, gradients and through optimizer steps. Otherwise the ablation compares two codes."""
    plain = build("popsan", encoder)
    reduced = build("bptsan", encoder, actor__dendritic__branches=1, actor__lateral__radius=0)
    assert [name for name, _ in plain.named_parameters()] == [name for name, _ in reduced.named_parameters()]
    first, second = train(plain), train(reduced)
    assert all(torch.equal(a, b) for a, b in zip(first, second, strict=True))
    assert max(float(grad.abs().max()) for grad in first) > 0
    assert not torch.equal(first[0], train(build("bptsan", encoder))[0])


VARIANTS = [
    {},
    {"actor__dendritic__branches": 3, "actor__dendritic__bias": "branch"},
    {"actor__dendritic__output_topology": True, "actor__lateral__include_self": True},
    {"actor__lateral__weights": "shared", "actor__reset_gradient": False, "actor__lateral_gradient": False},
    {"actor__time_steps": 1},
    {"actor__hidden_sizes": [16]},
    {"actor__hidden_sizes": [9, 300, 7], "actor__output_population": 4},
    {"encoder__learnable": False, "encoder__population_size": 3},
]


@pytest.mark.parametrize("encoder", ["deterministic", "poisson"])
@pytest.mark.parametrize("overrides", VARIANTS)
def test_equals_stepwise(overrides, encoder):
    """The whole actor against one product a step: values, health and all gradients."""
    results = []
    ours = build("bptsan", encoder, **overrides)
    for actor in (ours, stepwise(ours)):
        raw, health = actor.forward_with_health(observations(), stream())
        raw.square().sum().backward()
        results.append((raw.detach(), health, {name: p.grad for name, p in actor.named_parameters()}))
    (raw, health, grads), (expected_raw, expected_health, expected_grads) = results
    # Products of other shapes may differ in the last bits; a spike that flips on it would show as 0.2.
    torch.testing.assert_close(raw, expected_raw, rtol=1e-4, atol=1e-5)
    for layer, expected in zip(health.layers, expected_health.layers, strict=True):
        torch.testing.assert_close(torch.stack(layer), torch.stack(expected), rtol=1e-4, atol=1e-5)
    torch.testing.assert_close(health.input_firing_rate, expected_health.input_firing_rate)
    for name, expected in expected_grads.items():
        scale = float(expected.abs().max())
        torch.testing.assert_close(
            grads[name], expected, rtol=1e-3, atol=1e-4 * scale, msg=lambda m, n=name: f"{n}: {m}"
        )


@pytest.mark.parametrize("actor", [*SPIKING, "aan"])
def test_interface(actor):
    module = build(actor, "task" if actor == "aan" else "poisson")
    raw = module(observations(), stream())
    again, health = module.forward_with_health(observations(), stream())
    assert raw.shape == (20, 3)
    assert torch.equal(raw, again)
    again.sum().backward()
    assert any(parameter.grad.abs().sum() > 0 for parameter in module.parameters())
    layers = module.layer_parameters()
    assert len(layers) == len(health.layers) == (0 if actor == "aan" else 3)
    for layer in health.layers:
        assert all(value.dim() == 0 and not value.requires_grad and 0 <= value <= 1 for value in layer)
    assert set(module.state_dict()) == {name for name, _ in module.named_parameters()}
    module.project()
    with torch.no_grad():
        for batch in (1, 10, 4096 if actor == "bptsan" else 2):
            assert module(observations(batch), stream()).shape == (batch, 3)
        single = module.double()(observations().double(), stream())
    assert single.dtype == torch.float64


def test_acting_equals_training():
    """Without recorded gradients the action is the one that training sees."""
    actor = build()
    raw = actor(observations())
    with torch.no_grad():
        assert torch.equal(actor(observations()), raw)
        assert torch.equal(actor.forward_with_health(observations())[0], raw)


def test_poisson_draws_from_its_stream():
    actor = build(encoder="poisson")
    with pytest.raises(ValueError, match="generator"):
        actor(observations())
    with torch.no_grad():
        assert torch.equal(actor(observations(), stream(1)), actor(observations(), stream(1)))
        assert not torch.equal(actor(observations(), stream(1)), actor(observations(), stream(2)))


def test_connection_counts():
    """BPT-SAN has as many connections as PopSAN, plus its lateral weights [P]."""
    counts = {actor: build_actor(configuration(actor), 11, 3, Streams(0)).connection_count() for actor in SPIKING}
    synapses = 110 * 256 + 256 * 256 + 256 * 30
    assert counts["popsan"] == 2 * 110 + synapses + (256 + 256 + 30) + (30 + 3)
    assert counts["bptsan_wo_li"] == counts["popsan"]
    assert counts["bptsan"] == counts["bptsan_wo_ndt"] == counts["popsan"] + 2 * 4 * 256
    aan = build_actor(configuration("aan", "task"), 11, 3, Streams(0))
    assert aan.connection_count() == 12 * 256 + 257 * 256 + 257 * 3


@pytest.mark.parametrize("duplicate", [copy.deepcopy, lambda actor: pickle.loads(pickle.dumps(actor))])
def test_copies(duplicate):
    """A target network has the same dendrites, and weights of its own."""
    actor = build()
    with torch.no_grad():
        before = actor(observations())
    target = duplicate(actor)
    for mine, other in zip(actor.spiking_layers()[:2], target.spiking_layers()[:2], strict=True):
        assert torch.equal(mine.synapse.branch, other.synapse.branch)
    train(actor)
    with torch.no_grad():
        assert torch.equal(target(observations()), before)
        assert not torch.equal(actor(observations()), before)


def test_state_restores_another_instance():
    """A policy file holds parameters only; the partition comes back from the seed."""
    actor = build()
    train(actor)
    restored = build()
    restored.load_state_dict(actor.state_dict())
    with torch.no_grad():
        assert torch.equal(restored(observations()), actor(observations()))


def test_seeds():
    """Every parameter that is drawn moves with the seed; mask_seed holds the partition alone."""
    first, second = build(seed=0), build(seed=1)
    for (name, a), b in zip(first.named_parameters(), second.parameters(), strict=True):
        assert torch.equal(a, b) == name.startswith("encoder."), name
    branch = lambda actor: actor.spiking_layers()[0].synapse.branch  # noqa: E731
    assert not torch.equal(branch(first), branch(second))
    fixed = [build(seed=seed, actor__mask_seed=0) for seed in (1, 2)]
    assert torch.equal(branch(fixed[0]), branch(fixed[1]))
    assert torch.equal(branch(fixed[0]), branch(first))  # mask_seed 0 is a seed: the partition of run 0


def test_layers_move_no_other_weights():
    """A hidden layer more leaves the first layer's weights as they are."""
    deep = build(actor__hidden_sizes=[32, 24, 24]).state_dict()
    shallow = build().state_dict()
    assert torch.equal(deep["layers.0.synapse.weight"], shallow["layers.0.synapse.weight"])


def test_output_topology():
    assert build().spiking_layers()[-1].lateral is None
    full = build(actor__dendritic__output_topology=True).spiking_layers()[-1]
    assert full.lateral is not None
    assert full.synapse.branches == 2


def test_saturation_shows_in_the_health():
    """Neurons far above the threshold: always on, none inside the window."""
    actor = build("popsan")
    with torch.no_grad():
        for layer in actor.spiking_layers():
            layer.synapse.bias.fill_(100.0)
    health = actor.forward_with_health(observations())[1]
    for layer in health.layers:
        assert [float(value) for value in layer] == [1, 0, 1, 0]
    with torch.no_grad():
        for layer in actor.spiking_layers():
            layer.synapse.bias.fill_(-100.0)
    for layer in actor.forward_with_health(observations())[1].layers:
        assert [float(value) for value in layer] == [0, 0, 0, 1]


def test_aan_trunk_and_head():
    actor = build("aan", "task")
    assert isinstance(actor, MLPActor)
    features = actor.features(observations())
    assert features.shape == (20, 24)
    assert torch.equal(features, actor.hidden(observations())[0])
    assert torch.equal(actor.output(features).squeeze(0), actor(observations()))


class Custom(Actor):
    """A custom actor as CONTRIBUTING.md describes it."""

    def __init__(self, observation_size, action_size, streams, encoder, width=4):
        super().__init__()
        self.encoder, self.width = encoder, width
        self.map = nn.Linear(observation_size if encoder is None else encoder.size, action_size)

    def forward(self, observation, generator=None):
        return self.map(observation if self.encoder is None else self.encoder(observation, generator).mean(0))


def custom(target, spikes=False, **arguments):
    actor = {"kind": "custom", "name": "mine", "target": target, "arguments": arguments, "spikes": spikes}
    actor |= {"learning_rate": 1e-3, "log_std_network": "separate"}
    return configuration(
        encoder="deterministic" if spikes else "task",
        actor=actor,
        encoder__coding="deterministic" if spikes else "none",
    )


def test_custom_actor():
    name = f"{__name__}.Custom"
    plain = build_actor(custom(name, width=7), 11, 3, Streams(0))
    assert plain.encoder is None
    assert plain.width == 7
    spiking = build_actor(custom(name, spikes=True), 11, 3, Streams(0))
    spiking(observations()).sum().backward()
    assert spiking.encoder.mean.grad.abs().sum() > 0
    for target, words in [("no_such_module.Actor", "cannot import"), (f"{__name__}.Nothing", "cannot import")]:
        with pytest.raises(ConfigurationError, match=words):
            build_actor(custom(target), 11, 3, Streams(0))
    with pytest.raises(ConfigurationError, match="arguments"):
        build_actor(custom(name, depth=3), 11, 3, Streams(0))


def test_a_subclass_with_a_forward_of_its_own_learns_by_it():
    """Measuring health must not put the parent's pass in its place."""

    class Twice(SpikingActor):
        def forward(self, observation, generator=None):
            return 2 * super().forward(observation, generator)

    actor = build()
    raw = actor(observations())
    actor.__class__ = Twice
    measured, health = actor.forward_with_health(observations())
    assert torch.equal(measured, 2 * raw)
    assert health.layers == ()


@pytest.mark.parametrize("name", ["layers.1.synapse.weight", "encoder.mean"])
def test_parameters_that_do_not_learn_take_no_gradient(name):
    actor = build()
    actor.get_parameter(name).requires_grad_(False)
    actor(observations()).sum().backward()
    assert all((p.grad is None) == (other == name) for other, p in actor.named_parameters())


def test_an_empty_batch_gives_no_actions():
    actor = build()
    raw = actor(torch.zeros(0, 11))
    raw.sum().backward()
    assert raw.shape == (0, 3)
    assert not any(p.grad.any() for p in actor.parameters())


@pytest.mark.parametrize("actor", [*SPIKING, "aan"])
def test_any_device_and_precision(actor):
    """On the meta device nothing is computed: whatever asks for an address or a CPU tensor raises."""
    module = build(actor, "task" if actor == "aan" else "poisson")
    raw, _ = copy.deepcopy(module).to("meta").forward_with_health(observations().to("meta"), stream())
    assert raw.shape == (20, 3)
    raw.sum().backward()
    exact = module(observations(), stream())
    double = module.double()(observations().double(), stream())
    double.sum().backward()
    assert double.dtype == torch.float64
    torch.testing.assert_close(double.float(), exact, rtol=1e-4, atol=1e-5)


@pytest.mark.parametrize("encoder", ["deterministic", "poisson"])
def test_gradients_in_double_precision(encoder):
    """All gradients to 1e-10 of those of the steps; in float32 a small mistake could hide behind rounding."""
    actor = build("bptsan", encoder, actor__dendritic__branches=3).double()
    to_raw = torch.randn(20, 3, dtype=torch.float64, generator=stream())
    gradients = []
    for each in (actor, stepwise(actor)):
        raw = each(observations().double(), stream())
        gradients.append(torch.autograd.grad(raw, list(each.parameters()), to_raw))
    for ours, expected in zip(*gradients, strict=True):
        assert expected.abs().max() > 0
        torch.testing.assert_close(ours, expected, rtol=1e-9, atol=1e-10)
