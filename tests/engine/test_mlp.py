"""Bound multilayer perceptrons against the plain module and autograd."""

from __future__ import annotations

import pytest
import torch

from src.actors.mlp import EnsembleMLP
from src.algorithms.td3 import critic_loss
from src.engine.flat import FlatParameters
from src.engine.mlp import BoundMLP, BoundMLPActor, last_rows
from src.streams import Streams
from tests.engine.actors import ACTION_SIZE, OBSERVATION_SIZE, actor


def bind(sizes, ensemble=2, final_relu=False):
    network = EnsembleMLP(sizes, ensemble, Streams(0), "test", final_relu=final_relu)
    flat = FlatParameters(network.parameters())
    return network, BoundMLP(network), flat


@pytest.mark.parametrize("sizes", [[6, 33, 17, 3], [6, 9, 40, 17, 3], [6, 3]])  # the widest layer first, later, none
@pytest.mark.parametrize("final_relu", [False, True])
@pytest.mark.parametrize("batch", [1, 11, 100])
def test_values_and_gradients_are_autograds(sizes, final_relu, batch):
    network, bound, flat = bind(sizes, 3, final_relu)
    x, grad_outputs = torch.randn(batch, 6, requires_grad=True), torch.randn(3, batch, sizes[-1])
    expected = network(x)
    parameters = list(network.parameters())
    grad_input, *gradients = torch.autograd.grad(expected, [x, *parameters], grad_outputs)
    saved = bound.forward_saving(x.detach())
    torch.testing.assert_close(saved[-1], expected.detach())
    torch.testing.assert_close(bound.forward(x.detach()), expected.detach())
    flat.gradient.fill_(torch.nan)
    torch.testing.assert_close(bound.backward(saved, grad_outputs, with_input=True), grad_input, rtol=1e-4, atol=1e-5)
    for parameter, gradient in zip(parameters, gradients, strict=True):
        torch.testing.assert_close(parameter.grad, gradient, rtol=1e-4, atol=1e-5)
    assert bound.backward(saved, grad_outputs) is None


@pytest.mark.parametrize("batch", [1, 7, 300])
@pytest.mark.parametrize("ensemble", [1, 2])
def test_a_squared_error_step_is_autograds(batch, ensemble):
    """The loss on the plain path is the very function that TorchRL's is held against."""
    network, bound, _ = bind([5, 16, 24, 8, 1], ensemble)
    x, target = torch.randn(batch, 5), torch.randn(batch)
    values, loss = bound.squared_error_step(x, target)
    expected = network(x).squeeze(-1)
    expected_loss = critic_loss(expected, target)
    torch.testing.assert_close(values, expected.detach())
    torch.testing.assert_close(loss, expected_loss.detach())
    for parameter, gradient in zip(network.parameters(), torch.autograd.grad(expected_loss, network.parameters())):
        torch.testing.assert_close(parameter.grad, gradient)


@pytest.mark.parametrize("members", [1, 2, 3])
def test_the_gradient_of_the_smallest_output_is_autograds(members):
    network, bound, _ = bind([5, 16, 16, 1], 3)
    first, second = 9 * torch.randn(40, 3), 9 * torch.randn(40, 2)
    second.requires_grad_()
    x = torch.cat([first, second], -1)
    expected = network(x).squeeze(-1)[:members]
    assert members == 1 or len(expected.argmin(dim=0).unique()) == members  # each is the smallest somewhere
    outputs, gradient = bound.minimum_input_gradient(x.detach(), 3, -0.25, members)
    torch.testing.assert_close(outputs, expected.detach())
    (expected_gradient,) = torch.autograd.grad(-0.25 * expected.amin(dim=0).sum(), second)
    torch.testing.assert_close(gradient, expected_gradient)


def test_networks_that_tie_share_the_gradient():
    network, bound, _ = bind([5, 8, 1])
    for parameter in network.parameters():
        parameter.data[1] = parameter.data[0]
    x = torch.randn(6, 5)
    shared = bound.minimum_input_gradient(x, 3, 1.0, 2)[1]
    torch.testing.assert_close(shared, bound.minimum_input_gradient(x, 3, 1.0, 1)[1])


@pytest.mark.parametrize("member", [0, 1])
def test_nan_propagates(member):
    network, bound, _ = bind([5, 8, 1])
    network.biases[1].data[member] = torch.nan
    outputs, gradient = bound.minimum_input_gradient(torch.randn(6, 5), 3, 1.0, 2)
    assert outputs[member].isnan().all() and gradient.isnan().all()
    assert bound.forward(torch.full((4, 5), torch.nan)).isnan().all()


def test_the_last_rows_alone_are_a_minibatch_of_their_own():
    _, bound, flat = bind([6, 33, 3], 1)
    x, grad_outputs = torch.randn(20, 6), torch.randn(1, 8, 3)
    bound.backward(last_rows(bound.forward_saving(x), 8), grad_outputs)
    found = flat.gradient.clone()
    bound.backward(bound.forward_saving(x[12:]), grad_outputs)
    torch.testing.assert_close(found, flat.gradient, rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize("groups", [1, 3])
def test_the_aan_is_the_plain_module(groups):
    built = actor("aan")
    FlatParameters(built.parameters())
    bound = BoundMLPActor(built)
    observation, grad_raw = torch.randn(groups, 20, OBSERVATION_SIZE), torch.randn(20, ACTION_SIZE)
    expected = built(observation[-1])
    gradients = torch.autograd.grad(expected, list(built.parameters()), grad_raw)
    raw, _, vjp_fn = bound.vjp(observation, None, True)
    vjp_fn(grad_raw)
    torch.testing.assert_close(raw[-1], expected.detach())
    torch.testing.assert_close(bound.raw(observation, None), raw)
    torch.testing.assert_close(bound.raw_action(observation[-1], None), raw[-1])
    for parameter, gradient in zip(built.parameters(), gradients, strict=True):
        torch.testing.assert_close(parameter.grad, gradient, rtol=1e-4, atol=1e-5)


@pytest.mark.parametrize("wrong", [torch.zeros(4, 6), torch.zeros(4, 5).double()])
def test_what_would_read_beyond_an_array_is_refused(wrong):
    _, bound, _ = bind([5, 16, 8, 1])
    for call in (bound.forward, bound.forward_saving, lambda x: bound.squared_error_step(x, torch.zeros(4))):
        with pytest.raises(ValueError, match="the first layer takes 5"):
            call(wrong)
    with pytest.raises(ValueError, match=r"target"):
        bound.squared_error_step(torch.zeros(4, 5), torch.zeros(3))
    with pytest.raises(ValueError, match=r"the outputs are \[2, 4, 1\]"):
        bound.backward(bound.forward_saving(torch.zeros(4, 5)), torch.zeros(2, 3, 1))
