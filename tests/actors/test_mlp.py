"""If these fail, the critics and the AAN compute or learn something other than the networks of the paper."""

from __future__ import annotations

import pytest
import torch
from torch import nn

from src.actors.mlp import EnsembleMLP
from src.streams import Streams


def plain(network: EnsembleMLP, member: int) -> nn.Sequential:
    """One of the networks from torch.nn, sharing no code with ours."""
    layers: list[nn.Module] = []
    for weight, bias in zip(network.weights, network.biases):
        linear = nn.Linear(weight.shape[1], weight.shape[2], dtype=weight.dtype)
        linear.weight.data = weight[member].detach().t().clone()
        linear.bias.data = bias[member, 0].detach().clone()
        layers += [linear, nn.ReLU()]
    return nn.Sequential(*layers if network.final_relu else layers[:-1])


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
@pytest.mark.parametrize("final_relu", [False, True])  # True: a trunk
def test_values_and_all_gradients_agree_with_torch_nn(final_relu: bool, dtype: torch.dtype) -> None:
    network = EnsembleMLP([5, 16, 8, 3], 2, Streams(0), "test", final_relu=final_relu).to(dtype)
    x = torch.randn(7, 5, dtype=dtype, requires_grad=True)
    to_outputs = torch.randn(2, 7, 3, dtype=dtype)
    modules = [plain(network, member) for member in range(2)]
    outputs, expected = network(x), torch.stack([module(x) for module in modules])
    torch.testing.assert_close(outputs, expected)
    assert not final_relu or (outputs == 0).any()
    parameters = [*network.weights, *network.biases]
    to_x, *gradients = torch.autograd.grad(outputs, [x, *parameters], to_outputs)
    (expected_to_x,) = torch.autograd.grad(expected, x, to_outputs, retain_graph=True)
    torch.testing.assert_close(to_x, expected_to_x)
    expected.backward(to_outputs)
    for member, module in enumerate(modules):
        linears = [layer for layer in module if isinstance(layer, nn.Linear)]
        for k, linear in enumerate(linears):
            torch.testing.assert_close(gradients[k][member].t(), linear.weight.grad)
            torch.testing.assert_close(gradients[len(linears) + k][member, 0], linear.bias.grad)


def test_initial_weights_have_the_distribution_of_linear_and_differ_by_member() -> None:
    network = EnsembleMLP([400, 300, 1], 2, Streams(0), "test")
    weight, bias = network.weights[0], network.biases[0]
    assert weight.shape == (2, 400, 300) and bias.shape == (2, 1, 300)
    assert 0.0499 < float(weight.abs().max()) <= 0.05
    assert float(weight.std()) == pytest.approx(0.05 / 3**0.5, rel=0.02)
    assert not torch.equal(weight[0], weight[1])
    assert not torch.equal(weight[0], EnsembleMLP([400, 300, 1], 1, Streams(1), "test").weights[0][0])
    assert torch.equal(weight[0], EnsembleMLP([400, 300, 1], 1, Streams(0), "test").weights[0][0])


def test_a_network_that_is_not_a_number_says_so() -> None:
    outputs = EnsembleMLP([5, 8, 1], 2, Streams(0), "test")(torch.full((4, 5), torch.nan))
    assert outputs.isnan().all()


def test_inputs_of_another_size_are_refused() -> None:
    with pytest.raises(RuntimeError):
        EnsembleMLP([5, 8, 1], 2, Streams(0), "test")(torch.zeros(4, 6))
