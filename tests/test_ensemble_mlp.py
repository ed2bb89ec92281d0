"""If these fail, the critics compute or learn something other than the networks of the paper."""

import pytest
import torch
from torch import nn

from src import ensemble_mlp
from src.algorithms.critic import TwinCritic
from src.algorithms.td3 import critic_loss
from src.ensemble_mlp import EnsembleMLP
from src.places import fixed_places
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


def places(network: EnsembleMLP) -> dict[nn.Parameter, torch.Tensor]:
    """Where gradients go, in the order of the layers; what is not filled shows."""
    return {p: torch.full(p.shape, torch.nan, dtype=p.dtype) for p in network.parameter_pairs}


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])  # the kernel, PyTorch's operators
@pytest.mark.parametrize("final_relu", [False, True])  # True: a trunk
def test_values_and_all_gradients_agree_with_torch_nn(final_relu: bool, dtype: torch.dtype) -> None:
    network = EnsembleMLP([5, 16, 8, 3], 2, Streams(0), "test", final_relu=final_relu).to(dtype)
    x, weight = torch.randn(7, 5, dtype=dtype, requires_grad=True), torch.randn(2, 7, 3, dtype=dtype)
    modules = [plain(network, e).to(dtype) for e in range(2)]
    theirs = torch.stack([m(x) for m in modules])
    theirs = torch.relu(theirs) if final_relu else theirs
    ours, pull = network.vjp(x.detach())
    torch.testing.assert_close(ours, theirs)
    assert not ours.requires_grad and (not final_relu or (ours == 0).any())
    gradient_of = places(network)
    to_input, gradients = pull(weight, gradient_of, True), list(gradient_of.values())
    loss = (theirs * weight).sum()
    torch.testing.assert_close(to_input, torch.autograd.grad(loss, x, retain_graph=True)[0])
    for e, module in enumerate(modules):
        linears = [m for m in module if isinstance(m, nn.Linear)]
        expected = torch.autograd.grad(loss, [p for m in linears for p in (m.weight, m.bias)], retain_graph=True)
        for k in range(len(linears)):
            torch.testing.assert_close(gradients[2 * k][e].t(), expected[2 * k])
            torch.testing.assert_close(gradients[2 * k + 1][e, 0], expected[2 * k + 1])
    again = places(network)
    assert network.vjp(x.detach())[1](weight, again, False) is None
    assert all(torch.equal(a, b) for a, b in zip(gradients, again.values(), strict=True))
    torch.testing.assert_close(network(x), theirs)  # by autograd, too
    for a, b in zip(torch.autograd.grad((network(x) * weight).sum(), network.parameter_pairs), gradients):
        torch.testing.assert_close(a, b)


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])  # the kernel, PyTorch's operators
@pytest.mark.parametrize("members", [1, 2, 3])
def test_the_gradient_of_the_smallest_output_is_autograds(members: int, dtype: torch.dtype) -> None:
    network = EnsembleMLP([5, 16, 16, 1], 3, Streams(0), "test").to(dtype)
    first, second = 9 * torch.randn(40, 3, dtype=dtype), 9 * torch.randn(40, 2, dtype=dtype)
    second.requires_grad_()
    outputs, gradient = network.smallest_output_gradient(first, second, -0.25, members)
    expected = network(torch.cat([first, second], -1)).squeeze(-1)[:members]
    assert members == 1 or len(expected.argmin(dim=0).unique()) == members  # each is the smallest somewhere
    torch.testing.assert_close(outputs, expected)
    (expected_gradient,) = torch.autograd.grad(-0.25 * expected.amin(dim=0).sum(), second)
    torch.testing.assert_close(gradient, expected_gradient)
    assert not outputs.requires_grad and not gradient.requires_grad


def test_the_gradient_of_the_smallest_output_is_compiled_and_takes_strided_arrays(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    network = EnsembleMLP([5, 16, 16, 1], 2, Streams(0), "test")
    first, second = torch.randn(3, 8).t(), torch.randn(4, 8).t()[:, :2]
    expected = network.smallest_output_gradient(first.contiguous(), second.contiguous(), 1.0, 2)
    network.weights[1].data = network.weights[1].detach().transpose(1, 2).contiguous().transpose(1, 2)
    monkeypatch.setattr(ensemble_mlp, "_smallest_output_gradient", None)  # the way without the kernel
    for one, other in zip(network.smallest_output_gradient(first, second, 1.0, 2), expected, strict=True):
        assert torch.equal(one, other)


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
@pytest.mark.parametrize("member", [0, 1])
def test_the_smallest_of_what_is_not_a_number_is_none(member: int, dtype: torch.dtype) -> None:
    network = EnsembleMLP([5, 8, 1], 2, Streams(0), "test").to(dtype)
    network.biases[1].data[member] = torch.nan
    first, second = torch.randn(6, 3, dtype=dtype), torch.randn(6, 2, dtype=dtype)
    outputs, gradient = network.smallest_output_gradient(first, second, 1.0, 2)
    assert outputs[member].isnan().all()
    assert gradient.isnan().all()


@pytest.mark.parametrize("members", [0, 3])
def test_networks_that_are_not_there_are_refused(members: int) -> None:
    network = EnsembleMLP([5, 8, 1], 2, Streams(0), "test")
    with pytest.raises(ValueError, match="1 to 2 networks"):
        network.smallest_output_gradient(torch.randn(6, 3), torch.randn(6, 2), 1.0, members)


def test_networks_that_tie_share_the_gradient() -> None:
    network = EnsembleMLP([5, 8, 1], 2, Streams(0), "test")
    for parameter in network.parameters():
        parameter.data[1] = parameter.data[0]
    first, second = torch.randn(6, 3), torch.randn(6, 2, requires_grad=True)
    _, gradient = network.smallest_output_gradient(first, second, 1.0, 2)
    values = network(torch.cat([first, second], -1)).squeeze(-1)
    torch.testing.assert_close(gradient, torch.autograd.grad(torch.minimum(*values).sum(), second)[0])
    torch.testing.assert_close(gradient, network.smallest_output_gradient(first, second, 1.0, 1)[1])


def test_each_member_has_its_own_weights_in_the_default_linear_range() -> None:
    critic = TwinCritic(11, 3, (256, 256), Streams(3))
    weight = critic.networks.weights[1]
    assert not torch.equal(weight[0], weight[1])
    assert 0.99 / 16 < float(weight.detach().abs().max()) <= 1 / 16
    assert sum(p.numel() for p in critic.parameters()) == 2 * (14 * 256 + 256 + 256 * 256 + 256 + 256 + 1)


def test_a_layer_more_moves_no_other_layers_weights() -> None:
    shallow, deep = EnsembleMLP([4, 8, 8], 1, Streams(1), "x"), EnsembleMLP([4, 8, 8, 2], 1, Streams(1), "x")
    assert torch.equal(shallow.weights[1], deep.weights[1])


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])  # the kernel, PyTorch's operators
@pytest.mark.parametrize("batch", [1, 7, 300])
@pytest.mark.parametrize("ensemble", [1, 2])
def test_a_regression_step_fills_autograds_gradient(dtype: torch.dtype, batch: int, ensemble: int) -> None:
    network = EnsembleMLP([5, 16, 24, 8, 1], ensemble, Streams(0), "test").to(dtype)
    x, target = torch.randn(batch, 5, dtype=dtype), torch.randn(batch, dtype=dtype)
    gradient_of = places(network)
    values, loss = network.regress(x, target, gradient_of)
    theirs = torch.stack([plain(network, e).to(dtype)(x).squeeze(-1) for e in range(ensemble)])
    torch.testing.assert_close(values, theirs)
    expected = critic_loss(network(x).squeeze(-1), target)
    torch.testing.assert_close(loss, expected.detach())
    for ours, autograd in zip(gradient_of.values(), torch.autograd.grad(expected, network.parameter_pairs)):
        torch.testing.assert_close(ours, autograd)


def assert_near(a: torch.Tensor, b: torch.Tensor) -> None:
    torch.testing.assert_close(a, b, rtol=1e-4, atol=1e-4)


def assert_equal(a: torch.Tensor, b: torch.Tensor) -> None:
    assert torch.equal(a, b)


@pytest.mark.parametrize("sizes", [[6, 33, 17, 3], [6, 9, 40, 17, 3], [6, 3]])  # the widest layer first, later, none
@pytest.mark.parametrize("final_relu", [False, True])
def test_kernel_and_specification_agree_whatever_the_layout(
    sizes: list[int], final_relu: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    network = EnsembleMLP(sizes, 3, Streams(0), "test", final_relu=final_relu)
    with torch.no_grad():  # views of a larger tensor, transposed: no parameter is contiguous
        for p in network.parameters():
            p.data = torch.randn(p.shape[0], p.shape[2], p.shape[1] + 1).transpose(1, 2)[:, 1:]
    x, weight = torch.randn(6, 11).t(), torch.randn(1).expand(3, 11, sizes[-1])
    results = []
    for kernel in (True, False):
        if not kernel:
            monkeypatch.setattr("src.ensemble_mlp._takes_kernel", lambda *_: False)
        # At another alignment a library may give other bits: our buffers are aligned, PyTorch takes views as they are.
        same = assert_equal if kernel else assert_near
        y, pull = network.vjp(x)
        with fixed_places(network), torch.no_grad():  # a copy of what is not contiguous must not outlive its values
            same(network(x), y)
            network.weights[0].mul_(2)
            doubled, pull_doubled = network.vjp(x)
            pull_doubled(weight, again := places(network), True)
            network.weights[0].mul_(0.5)
            same(network(x), y)
        results.append([doubled, *again.values()])
        gradients = places(network)
        results.append([y, pull(weight, gradients, True), *gradients.values()])
    for ours, theirs in zip(results[: len(results) // 2], results[len(results) // 2 :], strict=True):
        for one, other in zip(ours, theirs, strict=True):
            torch.testing.assert_close(one, other, rtol=1e-4, atol=1e-4)


def test_the_kernel_is_taken_for_float32(monkeypatch: pytest.MonkeyPatch, network: EnsembleMLP) -> None:
    monkeypatch.setattr("src.ensemble_mlp.forward_kernel", lambda: lambda *_: pytest.fail("the kernel"))
    network.double().vjp(torch.randn(2, 5, dtype=torch.float64))
    with pytest.raises(pytest.fail.Exception):
        network.float().vjp(torch.randn(2, 5))
    with torch.no_grad(), pytest.raises(pytest.fail.Exception):
        network(torch.randn(2, 5))


def test_wrong_shapes_are_refused_and_not_read_beyond_their_end(network: EnsembleMLP) -> None:
    with pytest.raises(ValueError, match="6 columns, the first layer takes 5"):
        network.vjp(torch.randn(4, 6))
    for k, wrong in ((2, torch.zeros(2, 15, 8)), (3, torch.zeros(2, 1, 8).double()), (5, torch.zeros(1, 1, 3))):
        parameter = network.parameter_pairs[k]
        parameter.data, right = wrong, parameter.data
        with pytest.raises(ValueError, match="do not fit"):
            network.vjp(torch.randn(4, 5))
        parameter.data = right
    _, pull = network.vjp(torch.randn(4, 5))
    with pytest.raises(ValueError, match="outputs are"):
        pull(torch.randn(2, 4, 2), places(network), False)
    for p in network.parameter_pairs:
        for place in (torch.empty(1), torch.empty_like(p).double(), torch.empty(*p.shape, 2)[..., 0]):
            wrong = places(network) | {p: place}
            with pytest.raises(ValueError, match="contiguous tensor of its shape"):
                pull(torch.randn(2, 4, 3), wrong, False)
    with pytest.raises(ValueError, match="one output"):
        network.regress(torch.randn(4, 5), torch.randn(4), places(network))
    critic = EnsembleMLP([5, 8, 1], 2, Streams(0), "test")
    with pytest.raises(ValueError, match="a target"):
        critic.regress(torch.randn(4, 5), torch.randn(3), places(critic))
    with pytest.raises(ValueError, match="contiguous tensor"):
        critic.regress(torch.randn(4, 5), torch.randn(4), places(critic) | {critic.biases[0]: torch.empty(1)})


def test_a_gradient_on_another_device_and_places_of_other_networks_are_refused(network: EnsembleMLP) -> None:
    _, pull = network.vjp(torch.randn(4, 5))
    with pytest.raises(ValueError, match=r"the gradient to them .*, torch.float32, meta"):
        pull(torch.empty(2, 4, 3, device="meta"), places(network), False)
    critic, other = (EnsembleMLP([5, 8, 1], 2, Streams(seed), "test") for seed in (0, 1))
    with pytest.raises(ValueError, match="not of others"):
        critic.regress(torch.randn(4, 5), torch.randn(4), places(other))


def test_the_gradient_survives_that_parameters_move(network: EnsembleMLP) -> None:
    """As wrappers move them: the kernels take addresses."""
    x, g = torch.randn(4, 5), torch.randn(2, 4, 3)
    expected, found = places(network), places(network)
    network.vjp(x)[1](g, expected, False)
    _, pull = network.vjp(x)
    for parameter in network.parameter_pairs:
        parameter.data = parameter.data.clone()
    junk = [torch.full(p.shape, torch.nan) for p in network.parameter_pairs for _ in range(40)]
    pull(g, found, False)
    assert len(junk) == 240
    assert all(torch.equal(found[p], expected[p]) for p in network.parameter_pairs)


def test_what_is_not_a_number_is_not_hidden_by_a_relu(network: EnsembleMLP) -> None:
    y, pull = network.vjp(torch.full((4, 5), torch.nan))
    assert y.isnan().all()
    g = pull(torch.full_like(y, torch.nan), places(network), True)
    assert g is not None and g.isnan().all()
