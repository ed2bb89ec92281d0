"""The compiled actor against the operators it replaces, bit for bit, and against the steps one by one."""

from __future__ import annotations

import copy

import pytest
import torch

from src.actors import actor_op, population_encoder
from src.actors.build import build_actor
from src.streams import Streams
from tests.actors.configuration import configuration

OPTIONS = {
    "output_topology": {"actor__dendritic__output_topology": True},
    "branch_bias": {"actor__dendritic__bias": "branch"},
    "three_branches": {"actor__dendritic__branches": 3},
    "shared_lateral": {"actor__lateral__weights": "shared", "actor__lateral__include_self": True},
    "detached": {"actor__reset_gradient": False, "actor__lateral_gradient": False},
    "detached_reset": {"actor__reset_gradient": False},
    "detached_lateral": {"actor__lateral_gradient": False},
    "fixed_encoder": {"encoder__learnable": False},
    "one_step": {"actor__time_steps": 1, "actor__threshold": 0.05},
    "widths": {"actor__hidden_sizes": [33, 70, 17], "actor__threshold": 0.1},
    "one_layer": {"actor__hidden_sizes": [64], "actor__output_population": 1},
}


def results(actor, batch, fused, monkeypatch):
    """Raw action with and without gradient, health, and all gradients."""
    observation = torch.randn(batch, 11, generator=torch.Generator().manual_seed(2)).requires_grad_()
    draws = lambda: torch.Generator().manual_seed(3)  # noqa: E731
    with monkeypatch.context() as patch:
        if not fused:
            for module in (actor_op, population_encoder):
                patch.setattr(module, "takes_kernel", lambda tensor: False)
        raw, health = actor.forward_with_health(observation, draws())
        leaves = [observation, *actor.parameters()]
        gradients = torch.autograd.grad((raw * torch.linspace(-1, 1, raw.numel()).view_as(raw)).sum(), leaves)
        with torch.no_grad():
            acting = actor(observation, draws())
            watched, watched_health = actor.forward_with_health(observation, draws())
            with actor.fixed_weights():
                fixed = [actor(observation, draws()) for _ in range(2)]
    measured = [value for every in (health, watched_health) for layer in every.layers for value in layer]
    return [raw, acting, watched, *fixed, *measured, *gradients]


@pytest.mark.parametrize("encoder", ["poisson", "deterministic"])
@pytest.mark.parametrize("name", ["popsan", "bptsan_wo_ndt", "bptsan_wo_li", "bptsan"])
@pytest.mark.parametrize("batch", [1, 10, 100, 200])
def test_equals_the_operators(batch, name, encoder, monkeypatch):
    """If it fails, training moved in silence: an old run would no longer be reproduced."""
    actor = build_actor(configuration(name, encoder), 11, 3, Streams(0))
    fused, operators = (results(actor, batch, fused, monkeypatch) for fused in (True, False))
    assert len(fused) == len(operators)
    assert all(torch.equal(a, b) for a, b in zip(fused, operators))
    assert fused[-1].abs().sum() > 0


@pytest.mark.parametrize("option", OPTIONS)
def test_options_equal_the_operators(option, monkeypatch):
    actor = build_actor(configuration("bptsan", **OPTIONS[option]), 11, 3, Streams(0))
    fused, operators = (results(actor, 7, fused, monkeypatch) for fused in (True, False))
    assert all(torch.equal(a, b) for a, b in zip(fused, operators, strict=True))


@pytest.mark.parametrize("name", ["popsan", "bptsan"])
def test_equals_autograd_of_the_steps(name):
    """The gradients by hand are those that autograd finds through the same spikes, step by step."""
    gradients = []
    for reference in (False, True):
        actor = build_actor(configuration(name), 11, 3, Streams(0), reference=reference)
        actor(torch.randn(20, 11, generator=torch.Generator().manual_seed(2))).square().sum().backward()
        gradients.append([parameter.grad for parameter in actor.parameters()])
    for grad, expected in zip(*gradients, strict=True):
        torch.testing.assert_close(grad, expected, rtol=1e-3, atol=1e-4 * float(expected.abs().max()))


@pytest.mark.parametrize("name", ["popsan", "bptsan"])
@pytest.mark.parametrize("index", [0, 1, 2])
def test_non_contiguous_inputs_and_weights(name, index):
    actor = build_actor(configuration(name, "deterministic"), 11, 3, Streams(0))
    observation = torch.randn(11, 6)
    expected = actor(observation.t().contiguous())
    assert torch.equal(actor(observation.t()), expected)
    synapse = actor.spiking_layers()[index].synapse
    synapse.weight.data = synapse.weight.detach().t().contiguous().t()
    assert torch.equal(actor(observation.t()), expected)
    with torch.no_grad():
        assert torch.equal(actor(observation.t()), expected)


def test_a_transposed_gradient():
    actor = build_actor(configuration("popsan", actor__output_population=1), 11, 3, Streams(0))
    raw, gradient = actor(torch.randn(6, 11)), torch.randn(3, 6)
    leaves = list(actor.parameters())
    found = torch.autograd.grad(raw, leaves, gradient.t(), retain_graph=True)
    expected = torch.autograd.grad(raw, leaves, gradient.t().contiguous())
    assert all(torch.equal(a, b) for a, b in zip(found, expected, strict=True))


def test_the_gradient_survives_that_saved_tensors_move():
    """As checkpointing and offloading move them: the kernels take addresses."""
    actor = build_actor(configuration("bptsan", actor__lateral__weights="shared"), 11, 3, Streams(0))
    observation, leaves = torch.randn(6, 11), list(actor.parameters())
    expected = torch.autograd.grad(actor(observation).sum(), leaves)
    with torch.autograd.graph.saved_tensors_hooks(lambda tensor: tensor.clone(), lambda tensor: tensor.clone()):
        raw = actor(observation)
    for parameter in leaves:
        parameter.data = parameter.data.clone()
    junk = [torch.full((256, 256), torch.nan) for _ in range(40)]
    found = torch.autograd.grad(raw.sum(), leaves)
    assert len(junk) == 40
    assert all(torch.equal(a, b) for a, b in zip(found, expected, strict=True))


def test_an_empty_batch_gives_no_actions():
    actor = build_actor(configuration("bptsan", "deterministic"), 11, 3, Streams(0))
    raw = actor(torch.zeros(0, 11))
    assert raw.shape == (0, 3)
    gradients = torch.autograd.grad(raw.sum(), list(actor.parameters()))
    assert all(not gradient.any() for gradient in gradients)


def test_wrong_shapes_are_refused():
    """The kernels take addresses and check nothing."""
    actor = build_actor(configuration("bptsan", "deterministic"), 11, 3, Streams(0))
    with pytest.raises(ValueError, match=r"takes observations \[B, 11\], not \[2, 12\]"):
        actor(torch.zeros(2, 12))
    synapse, lateral = actor.spiking_layers()[1].synapse, actor.spiking_layers()[1].lateral
    for parameter, shape in ((synapse.weight, (256, 255)), (synapse.bias, (3,)), (lateral.weight, (1, 256))):
        before, parameter.data = parameter.data, torch.zeros(shape)
        with pytest.raises(ValueError, match="do not fit"):
            actor(torch.zeros(2, 11))
        parameter.data = before
    actor.layers.double()
    with pytest.raises(RuntimeError, match="dtype"):  # of the operators, which say so
        actor(torch.zeros(2, 11))


def test_a_second_derivative_is_refused_rather_than_wrong():
    actor = build_actor(configuration("bptsan", "deterministic"), 11, 3, Streams(0))
    (gradient,) = torch.autograd.grad(actor(torch.randn(4, 11)).square().sum(), actor.decoder.weight, create_graph=True)
    with pytest.raises(RuntimeError, match="once_differentiable"):
        gradient.square().sum().backward()


def test_copies_of_an_actor_compute_with_their_own_weights():
    """The target networks of TD3 are such copies."""
    actor = build_actor(configuration("bptsan", "deterministic"), 11, 3, Streams(0))
    twin, observation = copy.deepcopy(actor), torch.randn(4, 11)
    assert torch.equal(twin(observation), actor(observation))
    with torch.no_grad():
        for parameter in twin.parameters():
            parameter.mul_(0.5)
    assert not torch.equal(twin(observation), actor(observation))
