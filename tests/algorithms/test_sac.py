"""SAC's losses against TorchRL's SACLoss, in value and gradient. If these fail, SAC is not SAC."""

import math

import pytest
import torch
from tensordict.nn import TensorDictModule
from torch import nn
from torchrl.modules import NormalParamExtractor, ProbabilisticActor, TanhNormal, ValueOperator
from torchrl.objectives import SACLoss

from src.algorithms import sac
from src.algorithms.build import build_learner
from src.algorithms.critic import TwinCritic
from src.algorithms.sac_learner import SACLearner
from src.algorithms.td3 import critic_loss
from src.streams import Streams
from tests.algorithms.test_td3 import DISCOUNT, LIMIT, B, M, N, _Critic, copy_critic, make_batch
from tests.helpers import make_config

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
    action, log_probability = sac.tanh_gaussian_vjp(mean, log_std, noise, BOUNDS)[:2]
    u = 0.3 + math.exp(-0.5) * 1.2
    density = math.exp(-0.5 * 1.2**2) / (math.exp(-0.5) * math.sqrt(2 * math.pi)) / (1 - math.tanh(u) ** 2)
    assert float(action) == pytest.approx(math.tanh(u), rel=1e-6)
    assert float(log_probability) == pytest.approx(math.log(density), rel=1e-5)


def test_log_probability_stays_finite_where_tanh_saturates() -> None:
    zero = torch.tensor([[0.0]])
    _, log_probability, _ = sac.tanh_gaussian_vjp(torch.tensor([[40.0]]), zero, zero, BOUNDS)
    assert torch.isfinite(log_probability).all()


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])  # the kernel, PyTorch's operators
@pytest.mark.parametrize("scale", [1.0, 30.0])  # 30: the tanh is saturated
@pytest.mark.parametrize("log_std_scale", [1.5, 20.0])  # some, most are out of their bounds
def test_a_sample_and_its_gradient_are_what_the_equations_say(
    log_std_scale: float, scale: float, dtype: torch.dtype
) -> None:
    bounds = BOUNDS._replace(action_limit=2.0)
    mean, log_std = scale * torch.randn(50, 3), log_std_scale * torch.randn(50, 3)
    log_std[0, :2] = torch.tensor([bounds.log_std_min, bounds.log_std_max])  # the bounds themselves belong to them
    noise, weights = torch.randn(50, 3), (torch.randn(50, 3), torch.randn(50))
    action, log_probability, pull = sac.tanh_gaussian_vjp(*(x.to(dtype) for x in (mean, log_std, noise)), bounds)
    ours = action, log_probability, *pull(*(weight.to(dtype) for weight in weights))
    inputs = mean.double().requires_grad_(), log_std.double().requires_grad_()
    outputs = sac.tanh_gaussian(*inputs, noise.double(), bounds)
    theirs = *outputs, *torch.autograd.grad(outputs, inputs, [weight.double() for weight in weights])
    for a, b in zip(ours, theirs, strict=True):
        assert not a.requires_grad
        torch.testing.assert_close(a, b.to(dtype), rtol=1e-4, atol=1e-4)
    clamped = (log_std < bounds.log_std_min) | (log_std > bounds.log_std_max)
    assert clamped.any() and not ours[3][clamped].any() and ours[3][~clamped].any()


def test_a_sample_that_is_not_a_number_stays_none() -> None:
    one, none = torch.ones(1, 1), torch.full((1, 1), torch.nan)
    for mean, log_std in ((none, one), (one, none)):
        for value in sac.tanh_gaussian_vjp(mean, log_std, one, BOUNDS)[:2]:
            assert value.isnan().all()


def test_gradients_to_a_sample_of_other_shapes_are_refused() -> None:
    """The kernel checks nothing."""
    _, _, pull = sac.tanh_gaussian_vjp(*(torch.randn(4, 3) for _ in range(3)), BOUNDS)
    for shapes in (((3, 3), (4,)), ((4, 3), (3,))):
        with pytest.raises(ValueError, match=r"a sample is \[4, 3\]"):
            pull(*(torch.zeros(shape) for shape in shapes))
    for to_action, to_log_probability in (
        (torch.zeros(4, 3).double(), torch.zeros(4)),
        (torch.zeros(4, 3), torch.zeros(4).half()),
    ):
        with pytest.raises(ValueError, match="a sample is float32"):
            pull(to_action, to_log_probability)


def test_a_sample_and_its_gradient_take_any_layout() -> None:
    parts, weights = [torch.randn(4, 3) for _ in range(3)], (torch.randn(4, 3), torch.randn(4))
    action, log_probability, pull = sac.tanh_gaussian_vjp(*parts, BOUNDS)
    expected = action, log_probability, *pull(*weights)
    action, log_probability, pull = sac.tanh_gaussian_vjp(*(x.t().contiguous().t() for x in parts), BOUNDS)
    ours = action, log_probability, *pull(weights[0].t().contiguous().t(), weights[1].repeat_interleave(2)[::2])
    assert all(torch.equal(a, b) for a, b in zip(ours, expected, strict=True))


def test_parts_of_other_shapes_are_broadcast() -> None:
    mean, log_std, noise = torch.randn(4, 3), torch.randn(1, 3), torch.randn(4, 3)
    broadcast, whole = (sac.tanh_gaussian_vjp(mean, x, noise, BOUNDS) for x in (log_std, log_std.expand(4, 3)))
    for ours, theirs in zip(broadcast[:2], whole[:2], strict=True):
        torch.testing.assert_close(ours, theirs)


@pytest.mark.parametrize("kind", ["aan", "bptsan"])  # heads on a trunk, networks
def test_the_policys_gradients_are_autograds(kind: str) -> None:
    learner = build_learner(make_config(algo="sac", actor=kind), N, M, LIMIT, Streams(0))
    assert isinstance(learner, SACLearner)
    observation, noise, bounds = torch.randn(6, N), torch.randn(6, M), learner.gaussian.bounds
    before, before_noise = torch.randn(6, N), torch.randn(6, M)
    to_action, to_log_probability = torch.randn(6, M), torch.randn(6)
    first, (action, log_probability), _, pull = learner.gaussian.vjp_after(
        before, observation, (before_noise, noise), torch.Generator().manual_seed(3)
    )
    pull(to_action, to_log_probability, learner.gradient_of)
    actor, draws = learner.policy.actor, torch.Generator().manual_seed(3)
    sample = learner.gaussian.sample(before, before_noise, draws)
    torch.testing.assert_close(tuple(first), tuple(sample))
    again = torch.Generator()
    again.set_state(draws.get_state())
    if kind == "aan":
        features = actor.hidden(observation).squeeze(0)  # type: ignore[operator]
        mean, log_std = actor.output(features).squeeze(0), learner.log_std(features)  # type: ignore[operator]
    else:
        mean, log_std = actor(observation, draws), learner.log_std(observation)
    outputs = sac.tanh_gaussian(mean, log_std, noise, bounds)
    torch.testing.assert_close((action, log_probability), tuple(x.detach() for x in outputs))
    parameters = [*actor.parameters(), *learner.log_std.parameters()]
    assert set(parameters) == set(learner.gradient_of)
    for p, expected in zip(parameters, torch.autograd.grad(outputs, parameters, [to_action, to_log_probability])):
        torch.testing.assert_close(learner.gradient_of[p], expected, rtol=1e-4, atol=1e-5)
        assert expected.any()
    sample = learner.gaussian.sample(observation, noise, again)
    torch.testing.assert_close((sample.action, sample.log_probability), (action, log_probability))
