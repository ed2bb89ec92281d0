"""If these fail, the critics compute or learn something other than the networks of the paper."""

import pytest
import torch
from torch import nn

from src.algorithms.critic import TwinCritic
from src.ensemble_mlp import EnsembleMLP
from src.streams import Streams


def plain(network: EnsembleMLP, member: int) -> nn.Sequential:
    """The same network from torch.nn, sharing no code with ours."""
    layers: list[nn.Module] = []
    for weight, bias in zip(network.weights, network.biases):
        linear = nn.Linear(weight.shape[1], weight.shape[2])
        linear.weight.data = weight[member].detach().t().clone()
        linear.bias.data = bias[member, 0].detach().clone()
        layers += [linear, nn.ReLU()]
    return nn.Sequential(*layers[:-1])


@pytest.fixture
def network() -> EnsembleMLP:
    return EnsembleMLP([5, 16, 8, 3], 2, Streams(0), "test")


def test_values_and_all_gradients_agree_with_torch_nn(network: EnsembleMLP) -> None:
    first, second = torch.randn(7, 3, requires_grad=True), torch.randn(7, 2, requires_grad=True)
    weight = torch.randn(2, 7, 3)
    ours = network(first, second)
    gradients = torch.autograd.grad((ours * weight).sum(), [first, second, *network.parameters()])

    modules = [plain(network, e) for e in range(2)]
    x = torch.cat([first, second], -1)
    theirs = torch.stack([m(x) for m in modules])
    torch.testing.assert_close(ours, theirs)
    loss = (theirs * weight).sum()
    expected_first, expected_second = torch.autograd.grad(loss, [first, second], retain_graph=True)
    torch.testing.assert_close(gradients[0], expected_first)
    torch.testing.assert_close(gradients[1], expected_second)
    own = dict(zip([n for n, _ in network.named_parameters()], gradients[2:]))
    for e, module in enumerate(modules):
        linears = [m for m in module if isinstance(m, nn.Linear)]
        expected = torch.autograd.grad(loss, [p for m in linears for p in (m.weight, m.bias)], retain_graph=True)
        for k in range(len(linears)):
            torch.testing.assert_close(own[f"weights.{k}"][e].t(), expected[2 * k])
            torch.testing.assert_close(own[f"biases.{k}"][e, 0], expected[2 * k + 1])


def test_hand_written_backward_passes_gradcheck(network: EnsembleMLP) -> None:
    network = network.double()
    x = torch.randn(4, 5, dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(lambda value: network(value), (x,))


def test_a_trunk_ends_in_a_relu_and_its_gradient_stops_there() -> None:
    trunk = EnsembleMLP([5, 16, 8], 1, Streams(0), "test", final_relu=True)
    x, weight = torch.randn(7, 5, requires_grad=True), torch.randn(7, 8)
    ours = trunk(x)[0]
    theirs = torch.relu(plain(trunk, 0)(x))
    torch.testing.assert_close(ours, theirs)
    assert (ours == 0).any()
    (a,), (b,) = torch.autograd.grad((ours * weight).sum(), x), torch.autograd.grad((theirs * weight).sum(), x)
    torch.testing.assert_close(a, b)


def test_frozen_gives_no_gradient_to_the_network_but_the_right_one_to_the_input(network: EnsembleMLP) -> None:
    x = torch.randn(4, 5, requires_grad=True)
    frozen = network(x, members=1, frozen=True)
    free = network(x)[:1]
    torch.testing.assert_close(frozen, free)
    (a,) = torch.autograd.grad(frozen.sum(), x)
    (b,) = torch.autograd.grad(free.sum(), x)
    torch.testing.assert_close(a, b)
    with pytest.raises(RuntimeError):
        torch.autograd.grad(network(x, frozen=True).sum(), list(network.parameters()))


def test_each_member_has_its_own_weights_in_the_default_linear_range() -> None:
    critic = TwinCritic(11, 3, (256, 256), Streams(3))
    weight = critic.networks.weights[1]
    assert not torch.equal(weight[0], weight[1])
    assert 0.99 / 16 < float(weight.detach().abs().max()) <= 1 / 16
    assert sum(p.numel() for p in critic.parameters()) == 2 * (14 * 256 + 256 + 256 * 256 + 256 + 256 + 1)


def test_a_layer_more_moves_no_other_layers_weights() -> None:
    shallow, deep = EnsembleMLP([4, 8, 8], 1, Streams(1), "x"), EnsembleMLP([4, 8, 8, 2], 1, Streams(1), "x")
    assert torch.equal(shallow.weights[1], deep.weights[1])
