"""The compiled actor against the operators that it replaces, and against the steps one by one.

Weights are multiples of 2**-12 in these tests, so that the products of spikes are exact in any order: both sides then
spike alike whatever library multiplies, and values are asked to be equal bit for bit. Gradients are products of other
numbers, and are asked to agree.
"""

from __future__ import annotations

import pytest
import torch

from src.actors import population_encoder, spiking_network
from src.actors.build import build_actor
from src.streams import Streams
from tests.actors.configuration import configuration
from tests.actors.vjp import gradients, places

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
    "radius_1": {"actor__lateral__radius": 1},
    "radius_1_and_self": {"actor__lateral__radius": 1, "actor__lateral__include_self": True},
    "radius_3": {"actor__lateral__radius": 3},
    "radius_of_the_layer": {"actor__lateral__radius": 19, "actor__hidden_sizes": [30, 20]},
    "one_layer": {"actor__hidden_sizes": [64], "actor__output_population": 1},
}


def with_exact_products(actor):
    """Weights and biases of the synapses on a grid on which sums of spikes are exact in float32."""
    with torch.no_grad():
        for layer in actor.spiking_layers():
            for parameter in (layer.synapse.weight, layer.synapse.bias):
                parameter.copy_((parameter * 2**12).round() / 2**12)
    return actor


def assert_agree(fused, operators):
    """The raw actions and health bit for bit, the gradients to a tolerance."""
    values, gradients_of = fused
    expected_values, expected_gradients = operators
    assert all(torch.equal(a, b) for a, b in zip(values, expected_values, strict=True))
    for a, b in zip(gradients_of, expected_gradients, strict=True):
        torch.testing.assert_close(a, b, rtol=1e-4, atol=1e-5 * float(b.abs().max()))


def results(actor, batch, fused, monkeypatch):
    """Raw action with and without gradient, health, and all gradients."""
    observation = torch.randn(batch, 11, generator=torch.Generator().manual_seed(2))
    draws = lambda: torch.Generator().manual_seed(3)  # noqa: E731
    with monkeypatch.context() as patch:
        if not fused:
            for module in (spiking_network, population_encoder):
                patch.setattr(module, "takes_kernel", lambda tensor: False)
        raw, health, pull = actor.vjp(observation, draws(), with_health=True)
        gradient_of = places(actor)
        pull(torch.linspace(-1, 1, raw.numel()).view_as(raw), gradient_of)
        again, nothing, _ = actor.vjp(observation, draws())
        assert nothing is None and not raw.requires_grad
        with torch.no_grad():
            acting = actor(observation, draws())
            watched, watched_health = actor.forward_with_health(observation, draws())
            with actor.fixed_weights():
                fixed = [actor(observation, draws()) for _ in range(2)]
    measured = [value for every in (health, watched_health) for layer in every.layers for value in layer]
    return [raw, again, acting, watched, *fixed, *measured], list(gradient_of.values())


@pytest.mark.parametrize("encoder", ["poisson", "deterministic"])
@pytest.mark.parametrize("name", ["popsan", "bptsan_wo_ndt", "bptsan_wo_li", "bptsan"])
@pytest.mark.parametrize("batch", [1, 10, 100, 200])
def test_equals_the_operators(batch, name, encoder, monkeypatch):
    """If it fails, training moved in silence: an old run would no longer be reproduced."""
    actor = with_exact_products(build_actor(configuration(name, encoder), 11, 3, Streams(0)))
    fused, operators = (results(actor, batch, fused, monkeypatch) for fused in (True, False))
    assert_agree(fused, operators)
    assert fused[1][-1].abs().sum() > 0


@pytest.mark.parametrize("option", OPTIONS)
def test_options_equal_the_operators(option, monkeypatch):
    actor = with_exact_products(build_actor(configuration("bptsan", **OPTIONS[option]), 11, 3, Streams(0)))
    assert actor._network.weights(torch.zeros(1, 11), for_gradient=True) is not None
    fused, operators = (results(actor, 7, fused, monkeypatch) for fused in (True, False))
    assert_agree(fused, operators)


@pytest.mark.parametrize("encoder", ["poisson", "deterministic"])
@pytest.mark.parametrize("name", ["aan", "popsan", "bptsan"])
def test_minibatches_in_one_pass_are_those_one_after_the_other(name, encoder):
    """Each draws its own chance: grouping passes moves no number."""
    actor = build_actor(configuration(name, "task" if name == "aan" else encoder), 11, 3, Streams(0))
    if name != "aan":
        with_exact_products(actor)
    observation = torch.randn(3, 20, 11)
    together = actor.minibatches(observation, draws := torch.Generator().manual_seed(3))
    alone = torch.Generator().manual_seed(3)
    with torch.no_grad():
        separate = torch.stack([actor(minibatch, alone) for minibatch in observation])
    torch.testing.assert_close(together, separate, rtol=1e-6, atol=1e-6)
    assert torch.equal(draws.get_state(), alone.get_state())


@pytest.mark.parametrize("name", ["aan", "popsan", "bptsan"])
def test_a_pass_after_another_is_both_one_after_the_other(name):
    actor = build_actor(configuration(name, "task" if name == "aan" else "poisson"), 11, 3, Streams(0))
    if name != "aan":
        with_exact_products(actor)
    before, observation, to_raw = torch.randn(20, 11), torch.randn(20, 11), torch.randn(20, 3)
    first, raw, health, pull = actor.vjp_after(before, observation, torch.Generator().manual_seed(3), with_health=True)
    pull(to_raw, together := places(actor))
    draws = torch.Generator().manual_seed(3)
    with torch.no_grad():
        torch.testing.assert_close(first, actor(before, draws), rtol=1e-6, atol=1e-6)
    alone, alone_health, pull = actor.vjp(observation, draws, with_health=True)
    pull(to_raw, separate := places(actor))
    torch.testing.assert_close(raw, alone, rtol=1e-6, atol=1e-6)
    assert health == alone_health
    for parameter, gradient in together.items():
        torch.testing.assert_close(gradient, separate[parameter], rtol=1e-4, atol=1e-6)


@pytest.mark.parametrize("name", ["popsan", "bptsan"])
def test_equals_autograd_of_the_steps(name):
    """The gradients by hand are those that autograd finds through the same spikes, step by step."""
    observation = torch.randn(20, 11, generator=torch.Generator().manual_seed(2))
    (raw, *ours), (expected_raw, *expected) = (
        gradients(build_actor(configuration(name), 11, 3, Streams(0), reference=reference), observation, weight)
        for weight in [torch.randn(20, 3, generator=torch.Generator().manual_seed(4))]
        for reference in (False, True)
    )
    torch.testing.assert_close(raw, expected_raw)
    for grad, steps in zip(ours, expected, strict=True):
        torch.testing.assert_close(grad, steps, rtol=1e-3, atol=1e-4 * float(steps.abs().max()))


@pytest.mark.parametrize("name", ["popsan", "bptsan"])
@pytest.mark.parametrize("index", [0, 1, 2])
def test_non_contiguous_inputs_weights_and_gradients(name, index):
    actor = build_actor(configuration(name, "deterministic"), 11, 3, Streams(0))
    observation, to_raw = torch.randn(11, 6), torch.randn(3, 6)
    expected = gradients(actor, observation.t().contiguous(), to_raw.t().contiguous())
    synapse = actor.spiking_layers()[index].synapse
    synapse.weight.data = synapse.weight.detach().t().contiguous().t()
    found = gradients(actor, observation.t(), to_raw.t())
    assert all(torch.equal(a, b) for a, b in zip(found, expected, strict=True))
    with torch.no_grad():
        assert torch.equal(actor(observation.t()), expected[0])


def test_parameters_that_do_not_learn_have_no_gradient():
    actor = build_actor(configuration("bptsan", "deterministic", actor__lateral__weights="shared"), 11, 3, Streams(0))
    observation, to_raw = torch.randn(6, 11), torch.randn(6, 3)
    _, *expected = gradients(actor, observation, to_raw)
    for frozen in range(len(expected)):
        _, _, pull = actor.vjp(observation)
        gradient_of = places(actor)
        parameter = list(actor.parameters())[frozen]
        del gradient_of[parameter]
        pull(to_raw, gradient_of)
        others = [gradient for k, gradient in enumerate(expected) if k != frozen]
        assert all(torch.equal(a, b) for a, b in zip(gradient_of.values(), others, strict=True))


def test_an_empty_batch_gives_no_actions():
    actor = build_actor(configuration("bptsan", "deterministic"), 11, 3, Streams(0))
    raw, *found = gradients(actor, torch.zeros(0, 11), torch.zeros(0, 3))
    assert raw.shape == (0, 3)
    assert all(not gradient.any() for gradient in found)


@pytest.mark.parametrize("weights", ["per_neuron", "shared"])
def test_wrong_shapes_are_refused(weights):
    """The kernels take addresses and check nothing."""
    actor = build_actor(configuration("bptsan", "deterministic", actor__lateral__weights=weights), 11, 3, Streams(0))
    with pytest.raises(ValueError, match=r"takes observations \[B, 11\], not \[2, 12\]"):
        actor.vjp(torch.zeros(2, 12))
    for parameter in actor.parameters():
        _, _, pull = actor.vjp(torch.zeros(2, 11))
        whole = places(actor)
        for wrong in (torch.zeros(2, 4), torch.zeros(2, 3).double()):
            with pytest.raises(ValueError, match=r"raw action is \[2, 3\], float32"):
                pull(wrong, whole)
        for place in (torch.zeros(1), torch.zeros(parameter.shape).double(), torch.zeros(*parameter.shape, 2)[..., 0]):
            with pytest.raises(ValueError, match="contiguous tensor of its shape"):
                pull(torch.zeros(2, 3), whole | {parameter: place})
    synapse, lateral = actor.spiking_layers()[1].synapse, actor.spiking_layers()[1].lateral
    lateral_shape = (1, 256) if weights == "per_neuron" else (1,)
    for parameter, shape in ((synapse.weight, (256, 255)), (synapse.bias, (3,)), (lateral.weight, lateral_shape)):
        before, parameter.data = parameter.data, torch.zeros(shape)
        with pytest.raises(ValueError, match="do not fit"):
            actor.vjp(torch.zeros(2, 11))
        parameter.data = before
    actor.layers.double()
    with pytest.raises(RuntimeError, match="dtype"):  # of the operators, which say so
        actor.vjp(torch.zeros(2, 11))


@pytest.mark.parametrize("name", ["layers.1.synapse.weight", "decoder.weight"])
def test_a_frozen_parameter_need_not_be_contiguous(name):
    actor = build_actor(configuration("bptsan", "deterministic"), 11, 3, Streams(0))
    observation, to_raw = torch.randn(6, 11), torch.randn(6, 3)
    _, *expected = gradients(actor, observation, to_raw)
    weight = actor.get_parameter(name)
    weight.data = weight.detach().t().contiguous().t()
    gradient_of = {parameter: place for parameter, place in places(actor).items() if parameter is not weight}
    actor.vjp(observation)[2](to_raw.t().contiguous().t(), gradient_of)  # nor what comes in
    others = [g for p, g in zip(actor.parameters(), expected, strict=True) if p is not weight]
    assert all(torch.equal(a, b) for a, b in zip(gradient_of.values(), others, strict=True))


def test_a_second_derivative_is_refused_rather_than_wrong():
    actor = build_actor(configuration("bptsan", "deterministic"), 11, 3, Streams(0))
    weight = actor.spiking_layers()[0].synapse.weight
    (gradient,) = torch.autograd.grad(actor(torch.randn(4, 11)).square().sum(), weight, create_graph=True)
    with pytest.raises(RuntimeError, match="once_differentiable"):
        gradient.square().sum().backward()
