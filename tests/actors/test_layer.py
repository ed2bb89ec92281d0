"""A layer in one compiled call against the operators it replaces, bit for bit, and against the steps one by one."""

from __future__ import annotations

import pytest
import torch

from src.actors import spiking_layer
from src.actors.build import build_actor
from src.streams import Streams
from tests.actors.configuration import configuration

OPTIONS = {
    "output_topology": {"actor__dendritic__output_topology": True},
    "branch_bias": {"actor__dendritic__bias": "branch"},
    "three_branches": {"actor__dendritic__branches": 3},
    "shared_lateral": {"actor__lateral__weights": "shared", "actor__lateral__include_self": True},
    "detached": {"actor__reset_gradient": False, "actor__lateral_gradient": False},
    "fixed_encoder": {"encoder__learnable": False},
    "one_step": {"actor__time_steps": 1, "actor__hidden_sizes": [33, 70, 17]},
}


def results(actor, batch, fused, monkeypatch):
    """Raw action with and without gradient, health, and all gradients."""
    observation = torch.randn(batch, 11, generator=torch.Generator().manual_seed(2)).requires_grad_()
    draws = lambda: torch.Generator().manual_seed(3)  # noqa: E731
    with monkeypatch.context() as patch:
        if not fused:
            patch.setattr(spiking_layer, "takes_kernel", lambda tensor: False)
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


def test_non_contiguous_input_and_frozen_parts():
    """Strided spikes; and what needs no gradient gets none."""
    layer = build_actor(configuration("bptsan"), 11, 3, Streams(0)).spiking_layers()[1]
    spikes = (torch.rand(6, 5, 256, generator=torch.Generator().manual_seed(0)) < 0.3).float().transpose(0, 1)
    expected = layer(spikes.contiguous())[0]
    assert torch.equal(layer(spikes)[0], expected)
    assert layer(spikes[:, :0])[0].shape == (5, 0, 256)
    layer.synapse.weight.requires_grad_(False)
    layer(spikes)[0].mean(0).sum().backward()
    assert layer.synapse.weight.grad is None
    assert layer.synapse.bias.grad.abs().sum() > 0
