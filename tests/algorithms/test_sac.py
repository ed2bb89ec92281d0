"""SAC's losses against TorchRL's SACLoss, in value and gradient. If these fail, SAC is not SAC."""

import math

import pytest
import torch
from tensordict.nn import TensorDictModule
from torch import nn
from torchrl.modules import NormalParamExtractor, ProbabilisticActor, TanhNormal, ValueOperator
from torchrl.objectives import SACLoss

from src.algorithms import sac
from src.algorithms.networks import TwinCritic
from src.algorithms.td3 import critic_loss
from src.streams import Streams
from tests.algorithms.test_td3 import DISCOUNT, LIMIT, B, M, N, _Critic, copy_critic, make_batch

ALPHA = 0.2
BOUNDS = sac.Bounds(log_std_min=-20.0, log_std_max=2.0, action_limit=1.0)


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
        return sac.tanh_gaussian(mean, log_std, noise, BOUNDS._replace(action_limit=LIMIT))

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
    actor_loss = sac.actor_loss(log_probability, critic(batch["observation"], action), ALPHA)
    torch.testing.assert_close(actor_loss, theirs["loss_actor"], rtol=1e-4, atol=1e-5)

    theirs["loss_qvalue"].backward(retain_graph=True)
    for k, gradient in enumerate(torch.autograd.grad(loss, list(critic.networks.weights))):
        expected = oracle.qvalue_network_params["module", "net", str(2 * k), "weight"].grad
        torch.testing.assert_close(gradient.transpose(1, 2), expected, rtol=1e-4, atol=1e-5)
    theirs["loss_actor"].backward()
    parameters = oracle.actor_network_params["module", "0", "module", "0"]
    expected_gradients = [parameters[k, n].grad for k in ("0", "2") for n in ("weight", "bias")]
    gradients = torch.autograd.grad(actor_loss, list(network.parameters()))
    for gradient, expected in zip(gradients, expected_gradients, strict=True):
        torch.testing.assert_close(gradient, expected, rtol=1e-4, atol=1e-5)


def test_log_probability_is_the_change_of_variables() -> None:
    mean, log_std, noise = torch.tensor([[0.3]]), torch.tensor([[-0.5]]), torch.tensor([[1.2]])
    action, log_probability = sac.tanh_gaussian(mean, log_std, noise, BOUNDS)
    u = 0.3 + math.exp(-0.5) * 1.2
    density = math.exp(-0.5 * 1.2**2) / (math.exp(-0.5) * math.sqrt(2 * math.pi)) / (1 - math.tanh(u) ** 2)
    assert float(action) == pytest.approx(math.tanh(u), rel=1e-6)
    assert float(log_probability) == pytest.approx(math.log(density), rel=1e-5)


def test_log_probability_stays_finite_where_tanh_saturates() -> None:
    zero = torch.tensor([[0.0]])
    _, log_probability = sac.tanh_gaussian(torch.tensor([[40.0]]), zero, zero, BOUNDS)
    assert torch.isfinite(log_probability).all()


def test_a_sample_and_its_gradients_are_those_of_torch_distributions() -> None:
    """In double precision, log-probability and all gradients, some of the log-stds out of their bounds."""
    bounds = BOUNDS._replace(action_limit=2.0)
    generator = torch.Generator().manual_seed(0)
    mean, log_std, noise = (torch.randn(50, 3, generator=generator, dtype=torch.float64) for _ in range(3))
    log_std = 1.5 * log_std
    log_std[0, :2] = torch.tensor([bounds.log_std_min, bounds.log_std_max])  # the bounds belong to the range
    to_action, to_log_probability = torch.randn_like(mean), torch.randn(50, dtype=torch.float64)
    inputs = mean.requires_grad_(), log_std.requires_grad_()
    outputs = sac.tanh_gaussian(*inputs, noise, bounds)
    normal = torch.distributions.Normal(mean, log_std.clamp(bounds.log_std_min, bounds.log_std_max).exp())
    u = normal.mean + normal.stddev * noise
    squash = torch.distributions.TanhTransform(cache_size=1)
    density = normal.log_prob(u) - squash.log_abs_det_jacobian(u, squash(u))
    expected = 2.0 * squash(u), density.sum(-1)
    torch.testing.assert_close(outputs, expected)
    weights = [to_action, to_log_probability]
    gradients = torch.autograd.grad(outputs, inputs, weights)
    torch.testing.assert_close(gradients, torch.autograd.grad(expected, inputs, weights))
    clamped = (log_std < bounds.log_std_min) | (log_std > bounds.log_std_max)
    assert clamped.any() and not gradients[1][clamped].any() and gradients[1][~clamped].any()


def test_a_sample_that_is_not_a_number_says_so() -> None:
    one, nan = torch.ones(1, 1), torch.full((1, 1), torch.nan)
    for mean, log_std in ((nan, one), (one, nan)):
        for value in sac.tanh_gaussian(mean, log_std, one, BOUNDS):
            assert value.isnan().all()
