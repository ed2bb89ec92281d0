"""SAC's losses against TorchRL's SACLoss, in value and gradient. If these fail, SAC is not SAC."""

import math

import pytest
import torch
from tensordict.nn import TensorDictModule
from torch import nn
from torchrl.modules import NormalParamExtractor, ProbabilisticActor, TanhNormal, ValueOperator
from torchrl.objectives import SACLoss

from src.algorithms import sac
from src.algorithms.critic import TwinCritic
from src.algorithms.td3 import critic_loss
from src.streams import Streams
from tests.algorithms.test_td3 import DISCOUNT, LIMIT, B, M, N, _Critic, copy_critic, make_batch

ALPHA = 0.2


def make_actor() -> tuple[nn.Module, ProbabilisticActor]:
    network = nn.Sequential(nn.Linear(N, 8), nn.ReLU(), nn.Linear(8, 2 * M))
    module = TensorDictModule(
        nn.Sequential(network, NormalParamExtractor(scale_mapping="exp")), ["observation"], ["loc", "scale"]
    )
    actor = ProbabilisticActor(
        module,
        in_keys=["loc", "scale"],
        distribution_class=TanhNormal,
        distribution_kwargs={"low": -LIMIT, "high": LIMIT, "tanh_loc": False, "safe_tanh": False},
        return_log_prob=False,
    )
    return network, actor


def test_losses_and_gradients_equal_torchrls(monkeypatch: pytest.MonkeyPatch) -> None:
    batch = make_batch()
    network, actor = make_actor()
    noise = torch.randn(B, M)
    monkeypatch.setattr("torch.distributions.normal._standard_normal", lambda shape, dtype, device: noise.expand(shape))
    oracle = SACLoss(
        actor,
        ValueOperator(_Critic(), in_keys=["observation", "action"]),
        alpha_init=ALPHA,
        fixed_alpha=True,
        target_entropy=0.0,  # unused with a fixed temperature
        loss_function="l2",
        delay_qvalue=True,
        num_qvalue_nets=2,
    )
    oracle.make_value_estimator(gamma=DISCOUNT)
    for p in oracle.target_qvalue_network_params.values(True, True):
        p.data += 0.05 * torch.randn_like(p)
    theirs = oracle(batch.clone())

    critic, target_critic = TwinCritic(N, M, (8, 8), Streams(0)), TwinCritic(N, M, (8, 8), Streams(1))
    copy_critic(oracle.qvalue_network_params, critic)
    copy_critic(oracle.target_qvalue_network_params, target_critic)

    def sample(observation: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        mean, log_std = network(observation).chunk(2, dim=-1)
        return sac.tanh_gaussian(mean, log_std, noise, LIMIT)

    with torch.no_grad():
        next_action, next_log_probability = sample(batch["next", "observation"])
        target = sac.bellman_target(
            batch["next", "reward"].squeeze(-1),
            batch["next", "terminated"].squeeze(-1).float(),
            target_critic(batch["next", "observation"], next_action),
            next_log_probability,
            DISCOUNT,
            ALPHA,
        )
    loss = critic_loss(critic(batch["observation"], batch["action"]), target)
    torch.testing.assert_close(loss, theirs["loss_qvalue"], rtol=1e-4, atol=1e-5)
    action, log_probability = sample(batch["observation"])
    values, to_action = critic.action_gradient(batch["observation"], action, members=2)
    actor_loss = sac.actor_loss(log_probability, values, ALPHA)
    torch.testing.assert_close(actor_loss, theirs["loss_actor"], rtol=1e-4, atol=1e-5)

    theirs["loss_qvalue"].backward(retain_graph=True)
    for k, gradient in enumerate(torch.autograd.grad(loss, list(critic.networks.weights))):
        expected = oracle.qvalue_network_params["module", "net", str(2 * k), "weight"].grad
        torch.testing.assert_close(gradient.transpose(1, 2), expected, rtol=1e-4, atol=1e-5)
    theirs["loss_actor"].backward()
    parameters = oracle.actor_network_params["module", "0", "module", "0"]
    expected_gradients = [parameters[k, n].grad for k in ("0", "2") for n in ("weight", "bias")]
    to_log_probability = torch.full_like(log_probability, ALPHA / len(log_probability))
    gradients = torch.autograd.grad(
        [action, log_probability], list(network.parameters()), [to_action, to_log_probability]
    )
    for gradient, expected in zip(gradients, expected_gradients, strict=True):
        torch.testing.assert_close(gradient, expected, rtol=1e-4, atol=1e-5)


def test_log_probability_is_the_change_of_variables() -> None:
    mean, log_std, noise = torch.tensor([[0.3]]), torch.tensor([[-0.5]]), torch.tensor([[1.2]])
    action, log_probability = sac.tanh_gaussian(mean, log_std, noise, 1.0)
    u = 0.3 + math.exp(-0.5) * 1.2
    density = math.exp(-0.5 * 1.2**2) / (math.exp(-0.5) * math.sqrt(2 * math.pi)) / (1 - math.tanh(u) ** 2)
    assert float(action) == pytest.approx(math.tanh(u), rel=1e-6)
    assert float(log_probability) == pytest.approx(math.log(density), rel=1e-5)


def test_log_probability_stays_finite_where_tanh_saturates() -> None:
    _, log_probability = sac.tanh_gaussian(torch.tensor([[40.0]]), torch.tensor([[0.0]]), torch.tensor([[0.0]]), 1.0)
    assert torch.isfinite(log_probability).all()


@pytest.mark.parametrize("scale", [1.0, 30.0])  # 30: the tanh is saturated
def test_the_kernel_samples_what_the_equations_say(scale: float) -> None:
    mean, log_std = scale * torch.randn(50, 3), torch.randn(50, 3)
    noise, weights = torch.randn(50, 3), (torch.randn(50, 3), torch.randn(50))
    results = []
    for dtype, sample in ((torch.float32, sac.tanh_gaussian), (torch.float64, sac.tanh_gaussian_reference)):
        inputs = mean.to(dtype).requires_grad_(), log_std.to(dtype).requires_grad_()
        outputs = sample(*inputs, noise.to(dtype), 2.0)
        loss = sum((w.to(dtype) * x).sum() for w, x in zip(weights, outputs))
        results.append([*outputs, *torch.autograd.grad(loss, inputs)])  # type: ignore[arg-type]
    for ours, theirs in zip(*results):
        torch.testing.assert_close(ours, theirs.float(), rtol=1e-4, atol=1e-4)


def test_a_sample_may_be_asked_for_one_of_its_two_parts() -> None:
    inputs = [torch.randn(4, 3, requires_grad=True) for _ in range(2)]
    noise = torch.randn(4, 3)
    for part in (0, 1):
        ours = torch.autograd.grad(sac.tanh_gaussian(*inputs, noise, 1.0)[part].sum(), inputs)
        theirs = torch.autograd.grad(sac.tanh_gaussian_reference(*inputs, noise, 1.0)[part].sum(), inputs)
        for a, b in zip(ours, theirs):
            torch.testing.assert_close(a, b)


def test_parts_of_other_shapes_are_broadcast() -> None:
    mean, log_std, noise = torch.randn(4, 3), torch.randn(1, 3), torch.randn(4, 3)
    for ours, theirs in zip(
        sac.tanh_gaussian(mean, log_std, noise, 1.0),
        sac.tanh_gaussian_reference(mean, log_std.expand(4, 3), noise, 1.0),
    ):
        torch.testing.assert_close(ours, theirs)
