"""Which weights the kernels take, and when they must not: they get addresses, and check nothing."""

from __future__ import annotations

import copy
import pickle
from contextlib import nullcontext

import pytest
import torch
from torch.nn.utils.parametrize import register_parametrization

from src.actors.build import build_actor
from src.actors.spiking_actor import SpikingActor
from src.places import fixed_places
from src.streams import Streams
from tests.actors.configuration import configuration
from tests.actors.vjp import gradients, places


@pytest.mark.parametrize("with_health", [False, True])
def test_a_subclass_learns_by_autograd_through_its_own_forward(with_health):
    class Twice(SpikingActor):
        def forward(self, observation, generator=None):
            return 2 * super().forward(observation, generator)

    actor = build_actor(configuration("bptsan", "deterministic"), 11, 3, Streams(0))
    observation, to_raw = torch.randn(6, 11), torch.randn(6, 3)
    raw, *expected = gradients(actor, observation, to_raw)
    actor.__class__ = Twice
    twice, health, pull = actor.vjp(observation, with_health=with_health)
    assert torch.equal(twice, 2 * raw) and (health is not None) == with_health
    gradient_of = places(actor)
    pull(to_raw, gradient_of)
    for ours, theirs in zip(gradient_of.values(), expected, strict=True):
        torch.testing.assert_close(ours, 2 * theirs, rtol=1e-4, atol=1e-6)


class Doubled(torch.nn.Module):
    """A parameter made of another."""

    def forward(self, original):
        return 2 * original


@pytest.mark.parametrize("remembers", [False, True])  # what was found before it changed must not serve
@pytest.mark.parametrize(
    "name",
    [
        "layers.0.synapse.weight", "layers.1.synapse.bias", "layers.1.lateral.weight", "decoder.weight", "decoder.bias",
        "encoder.mean", "encoder.std",
    ],
)  # fmt: skip
def test_a_parameter_made_of_another_learns_by_autograd(name, remembers):
    actor = build_actor(configuration("bptsan", "deterministic"), 11, 3, Streams(0))
    observation, to_raw = torch.randn(6, 11), torch.randn(6, 3)
    raw, *expected = gradients(actor, observation, to_raw)
    gradient = expected[[other for other, _ in actor.named_parameters()].index(name)]
    path, _, attribute = name.rpartition(".")
    module = actor.get_submodule(path)
    register_parametrization(module, attribute, Doubled(), unsafe=True)
    original = module.parametrizations[attribute].original
    with fixed_places(actor) if remembers else nullcontext():
        with torch.no_grad():
            assert not torch.equal(actor(observation), raw)
            original.mul_(0.5)
            assert torch.equal(actor(observation), raw)
        found, _, pull = actor.vjp(observation)
        gradient_of = places(actor)
        pull(to_raw, gradient_of)
    assert torch.equal(found, raw)
    torch.testing.assert_close(gradient_of[original], 2 * gradient)


def test_parameters_that_serve_twice_learn_from_both():
    actor = build_actor(configuration("popsan", "deterministic", actor__hidden_sizes=[64, 64, 64]), 11, 3, Streams(0))
    layers = actor.spiking_layers()
    layers[2].synapse.weight = layers[1].synapse.weight
    observation, to_raw = torch.randn(6, 11), torch.randn(6, 3)
    _, *found = gradients(actor, observation, to_raw)
    expected = torch.autograd.grad(actor(observation), list(actor.parameters()), to_raw)
    assert all(torch.equal(a, b) for a, b in zip(found, expected, strict=True))


def test_the_gradient_survives_that_parameters_move():
    """As wrappers move them: the kernels take addresses."""
    actor = build_actor(configuration("bptsan", "deterministic"), 11, 3, Streams(0))
    observation, to_raw = torch.randn(6, 11), torch.randn(6, 3)
    _, *expected = gradients(actor, observation, to_raw)
    _, _, pull = actor.vjp(observation)
    for parameter in actor.parameters():
        parameter.data = parameter.data.clone()
    junk = [torch.full((256, 256), torch.nan) for _ in range(40)]
    gradient_of = places(actor)
    pull(to_raw, gradient_of)
    assert len(junk) == 40
    assert all(torch.equal(a, b) for a, b in zip(gradient_of.values(), expected, strict=True))


@pytest.mark.parametrize("name", ["layers.1.synapse.bias", "layers.1.lateral.weight", "decoder.bias", "encoder.std"])
def test_mixed_precision_is_not_read_as_float32(name):
    actor = build_actor(configuration("bptsan", "deterministic"), 11, 3, Streams(0))
    parameter = dict(actor.named_parameters())[name]
    parameter.data = parameter.data.double()
    for for_gradient in (False, True):
        assert actor._network.weights(torch.zeros(2, 11), for_gradient) is None


@pytest.mark.parametrize("name", ["layers.0.synapse.weight", "layers.1.synapse.bias", "layers.1.lateral.weight"])
def test_weights_that_move_or_change_are_seen(name):
    """The kernels take addresses, looked up at each pass."""
    actor = build_actor(configuration("bptsan", "deterministic"), 11, 3, Streams(0))
    observation, parameter = torch.randn(6, 11), dict(actor.named_parameters())[name]

    def raws():
        found = [actor.vjp(observation)[0]]
        with torch.no_grad():
            found.append(actor(observation))
            with actor.fixed_weights():
                found.append(actor(observation))
        return found

    before = raws()
    assert all(torch.equal(raw, before[0]) for raw in before)
    old = parameter.data
    parameter.data = old + 0.3
    moved = raws()
    assert all(torch.equal(raw, moved[0]) for raw in moved) and not torch.equal(moved[0], before[0])
    old.fill_(torch.nan)  # where it was
    assert all(torch.equal(raw, moved[0]) for raw in raws())
    parameter.data.sub_(0.3)  # in place, as optimizers do
    changed = raws()
    assert all(torch.equal(raw, changed[0]) for raw in changed) and not torch.equal(changed[0], moved[0])
    module = actor.get_submodule(name.rpartition(".")[0])
    setattr(module, name.rpartition(".")[2], torch.nn.Parameter(parameter.detach() + 0.3))
    assert all(torch.equal(raw, moved[0]) or torch.allclose(raw, moved[0]) for raw in raws())


@pytest.mark.parametrize("option", ["shared", "transposed"])
def test_weights_that_are_copied_for_the_kernels_are_copied_anew(option):
    shared = {"actor__lateral__weights": "shared"} if option == "shared" else {}
    actor = build_actor(configuration("bptsan", "deterministic", **shared), 11, 3, Streams(0))
    layer, observation = actor.spiking_layers()[1], torch.randn(6, 11)
    if option == "transposed":
        layer.synapse.weight.data = layer.synapse.weight.detach().t().contiguous().t()
    with fixed_places(actor):
        before = actor.vjp(observation)[0]
        (layer.lateral if option == "shared" else layer.synapse).weight.data.add_(0.3)
        assert not torch.equal(actor.vjp(observation)[0], before)


def test_copies_of_an_actor_compute_with_their_own_weights():
    """The target networks of TD3 are such copies."""
    actor = build_actor(configuration("bptsan", "deterministic"), 11, 3, Streams(0))
    observation = torch.randn(4, 11)
    with fixed_places(actor):
        raw = actor.vjp(observation)[0]
        twin = copy.deepcopy(actor)  # what was found at the pass does not go into it
    with fixed_places(twin), torch.no_grad():
        for factor in (0.5, 2.0):
            for parameter in twin.layers.parameters():
                parameter.mul_(factor)
            assert torch.equal(twin.vjp(observation)[0], raw) == (factor == 2.0)
    assert torch.equal(actor.vjp(observation)[0], raw)


def test_a_pickle_holds_no_addresses():
    actor = build_actor(configuration("bptsan", "deterministic"), 11, 3, Streams(0))
    size = len(pickle.dumps(actor))
    with torch.no_grad(), fixed_places(actor):
        actor(torch.randn(4, 11))
        assert len(pickle.dumps(actor)) == size
