"""The learners against naive loops of torch.nn, torch.optim and deep copies: is the update the one that is stated?"""

from __future__ import annotations

import copy
import math
from dataclasses import replace

import pytest
import torch
from torch import Tensor, nn

from src.actors.actor import Actor
from src.algorithms.build import build_learner
from src.algorithms.learner import Batch, Learner, UpdateStreams
from src.algorithms.metrics import Diverged
from src.algorithms.networks import TwinCritic
from src.algorithms.sac import SAC
from src.algorithms.td3 import TD3
from src.config.schema import ConfigurationError, CustomActorConfig
from src.streams import Streams
from tests.helpers import make_config

N, M, SEED = 5, 3, 3
SMALL = {"actor.hidden_sizes": [32, 32], "algo.critic_hidden_sizes": [32, 32]}
BACKENDS = ("plain", "fast")


@pytest.fixture(params=BACKENDS)
def backend(request: pytest.FixtureRequest) -> str:
    """What computes the updates: all of this holds for each."""
    return str(request.param)


def make_learner(algo: str, actor: str, encoder: str, backend: str = "plain", **overrides: object) -> Learner:
    config = make_config(SMALL | {"backend": backend} | overrides, algo=algo, actor=actor, encoder=encoder)
    learner = build_learner(config, N, M, 1.0, Streams(SEED))
    assert learner.backend == backend
    return learner


def make_burst(seed: int, count: int = 7, batch: int = 20) -> Batch:
    g = torch.Generator().manual_seed(seed)
    return Batch(
        torch.randn(count, batch, N, generator=g).clamp(-3, 3),
        torch.rand(count, batch, M, generator=g) * 2 - 1,
        torch.randn(count, batch, generator=g),
        torch.randn(count, batch, N, generator=g).clamp(-3, 3),
        (torch.rand(count, batch, generator=g) < 0.3).float(),
    )


class NaiveCritics(nn.Module):
    """The same two critics from torch.nn.Linear."""

    def __init__(self, critic: TwinCritic) -> None:
        super().__init__()
        self.nets = nn.ModuleList()
        for member in range(2):
            layers: list[nn.Module] = []
            for weight, bias in zip(critic.networks.weights, critic.networks.biases):
                linear = nn.Linear(weight.shape[1], weight.shape[2])
                linear.weight.data = weight.detach()[member].T.clone()
                linear.bias.data = bias.detach()[member, 0].clone()
                layers += [linear, nn.ReLU()]
            self.nets.append(nn.Sequential(*layers[:-1]))

    def forward(self, observation: Tensor, action: Tensor) -> list[Tensor]:
        return [net(torch.cat([observation, action], -1)).squeeze(-1) for net in self.nets]


def polyak(target: nn.Module, online: nn.Module) -> None:
    with torch.no_grad():
        for t, p in zip(target.parameters(), online.parameters()):
            t.mul_(0.995).add_(0.005 * p)


def step(optimizer: torch.optim.Optimizer, loss: Tensor) -> None:
    optimizer.zero_grad()
    loss.backward()
    optimizer.step()


def assert_same(ours: nn.Module, theirs: nn.Module, tolerance: float = 2e-5) -> None:
    for a, b in zip(ours.parameters(), theirs.parameters(), strict=True):
        torch.testing.assert_close(a, b, rtol=0, atol=tolerance)


@pytest.mark.parametrize("delay", [1, 2, 3])
@pytest.mark.parametrize("actor,encoder", [("aan", "task"), ("bptsan", "deterministic"), ("bptsan", "poisson")])
def test_td3_is_spinning_ups_loop(actor: str, encoder: str, delay: int, backend: str) -> None:
    learner = make_learner("td3", actor, encoder, backend, **{"algo.policy_delay": delay})
    assert isinstance(learner, TD3)
    pi, q = copy.deepcopy(learner.policy.actor), NaiveCritics(learner.critic)
    target_pi, target_q = copy.deepcopy(pi), copy.deepcopy(q)
    draws, smoothing = Streams(SEED).torch("encoder"), Streams(SEED).torch("target noise")
    actor_adam = torch.optim.Adam(pi.parameters(), lr=learner.config.actor_learning_rate)
    critic_adam = torch.optim.Adam(q.parameters(), lr=1e-3)
    updates = 0
    for burst in (make_burst(1), make_burst(2)):  # odd lengths: the delay counts on through the second
        noise = 0.2 * torch.randn(burst.action.shape, generator=smoothing)
        recorded: list[list[float]] = []
        actor_losses: list[Tensor] = []
        for index, (o, a, r, o2, d) in enumerate(zip(*burst)):
            with torch.no_grad():
                a2 = (torch.tanh(target_pi(o2, draws)) + noise[index].clamp(-0.5, 0.5)).clamp(-1, 1)
                y = r + 0.99 * (1 - d) * torch.min(*target_q(o2, a2))
            values = q(o, a)
            loss = sum(((value - y) ** 2).mean() for value in values)
            step(critic_adam, loss)  # type: ignore[arg-type]
            recorded.append([x.detach().item() for x in (loss, *(value.mean() for value in values))])  # type: ignore[union-attr]
            if updates % delay == 0:
                actor_losses.append(-q(o, torch.tanh(pi(o, draws)))[0].mean())
                step(actor_adam, actor_losses[-1])
                pi.project()
                polyak(target_pi, pi)
                polyak(target_q, q)
            updates += 1
        report = learner.learn(burst)
        assert report["actor_loss"] == pytest.approx(
            float(torch.stack(actor_losses).detach().mean()), rel=1e-3, abs=1e-4
        )
        means = torch.tensor(recorded).mean(0)
        torch.testing.assert_close(
            torch.tensor([report[k] for k in ("critic_loss", "q1", "q2")]), means, rtol=1e-3, atol=1e-4
        )
    assert (learner.critic_updates, learner.actor_updates) == (14, math.ceil(14 / delay))
    assert_same(learner.policy.actor, pi)
    assert_same(learner.target_policy.actor, target_pi)
    assert_same(NaiveCritics(learner.critic), q)
    assert_same(NaiveCritics(learner.target_critic), target_q)


@pytest.mark.parametrize("actor,encoder", [("aan", "task"), ("bptsan", "poisson")])
def test_sac_is_spinning_ups_loop(actor: str, encoder: str, backend: str) -> None:
    learner = make_learner("sac", actor, encoder, backend)
    assert isinstance(learner, SAC)
    pi, log_std, q = copy.deepcopy(learner.policy.actor), copy.deepcopy(learner.log_std), NaiveCritics(learner.critic)
    target_q = copy.deepcopy(q)
    draws, normal = Streams(SEED).torch("encoder"), Streams(SEED).torch("policy noise")
    groups = [
        {"params": list(pi.parameters()), "lr": learner.config.actor_learning_rate},
        {"params": list(log_std.parameters()), "lr": 1e-3},
    ]
    actor_adam, critic_adam = torch.optim.Adam(groups), torch.optim.Adam(q.parameters(), lr=1e-3)

    def sample(o: Tensor, noise: Tensor) -> tuple[Tensor, Tensor]:
        if actor == "aan":
            features = pi.hidden(o).squeeze(0)  # type: ignore[operator]
            mean, std = pi.output(features).squeeze(0), log_std(features).exp()  # type: ignore[operator]
        else:
            mean, std = pi(o, draws), log_std(o).exp()
        u = mean + std * noise
        density = torch.distributions.Normal(mean, std).log_prob(u).sum(-1)
        return torch.tanh(u), density - (2 * (math.log(2) - u - nn.functional.softplus(-2 * u))).sum(-1)

    burst = make_burst(1)
    noise, recorded = torch.randn((2, *burst.action.shape), generator=normal), []
    for index, (o, a, r, o2, d) in enumerate(zip(*burst)):
        with torch.no_grad():
            a2, entropy = sample(o2, noise[0][index])
            y = r + 0.99 * (1 - d) * (torch.min(*target_q(o2, a2)) - 0.2 * entropy)
        step(critic_adam, sum(((value - y) ** 2).mean() for value in q(o, a)))  # type: ignore[arg-type]
        action, log_probability = sample(o, noise[1][index])
        recorded.append(
            torch.stack([(0.2 * log_probability - torch.min(*q(o, action))).mean(), log_probability.mean()])
        )
        step(actor_adam, recorded[-1][0])
        pi.project()
        polyak(target_q, q)
    report = learner.learn(burst)
    expected = torch.stack(recorded).mean(0).tolist()
    assert [report["actor_loss"], report["log_probability"]] == pytest.approx(expected, rel=1e-3, abs=1e-4)
    assert_same(learner.policy.actor, pi)
    assert_same(learner.log_std, log_std, tolerance=2e-4)
    assert_same(NaiveCritics(learner.critic), q)
    assert_same(NaiveCritics(learner.target_critic), target_q)


def test_td3_explores_with_the_stated_noise_inside_the_action_limit(backend: str) -> None:
    learner = make_learner("td3", "aan", "task", backend)
    observation = torch.zeros(1, N).expand(20_000, N)
    difference = learner.explore(observation) - learner.policy(observation)
    assert float(difference.detach().std()) == pytest.approx(0.1, rel=0.05)
    learner.policy.actor.output.biases[0].data.fill_(50.0)  # tanh saturates at the limit
    assert float(learner.explore(observation).max()) <= 1.0


@pytest.mark.parametrize("limit", [0.4, 3.0])
def test_noise_is_in_units_of_the_action_limit(limit: float) -> None:
    """Absolute noise would be half of the range of a task with limit 0.4, and nothing at limit 3."""
    config = make_config(SMALL | {"backend": "plain"}, algo="td3", actor="aan", encoder="task")
    learner = build_learner(config, N, M, limit, Streams(SEED))
    observation = torch.zeros(1, N).expand(20_000, N)
    difference = learner.explore(observation) - learner.policy(observation)
    assert float(difference.detach().std()) == pytest.approx(0.1 * limit, rel=0.05)
    seen = []
    learner.target_critic.forward = lambda observation, action: seen.append(action) or torch.zeros(2, len(action))
    burst = make_burst(1, count=1, batch=20_000)
    learner.learn(burst)
    smoothing = seen[0] - learner.target_policy(burst.next_observation[0])
    assert float(smoothing.abs().max()) == pytest.approx(0.5 * limit, rel=0.02)
    assert 0.15 * limit < float(smoothing.std()) < 0.2 * limit


@pytest.mark.parametrize("algo", ["td3", "sac"])
def test_sigma_is_projected_after_an_actor_step(algo: str, backend: str) -> None:
    learner = make_learner(algo, "popsan", "deterministic", backend)
    with torch.no_grad():
        learner.policy.actor.encoder.std.fill_(1e-9)
    learner.learn(make_burst(1, count=1))
    assert float(learner.policy.actor.encoder.std.min()) >= 1e-3 - 1e-9


@pytest.mark.parametrize("algo", ["td3", "sac"])
def test_a_loss_that_is_not_finite_ends_the_burst(algo: str, backend: str) -> None:
    burst = make_burst(1)
    burst.reward[3, 5] = torch.inf
    with pytest.raises(Diverged, match="critic_loss"):
        make_learner(algo, "aan", "task", backend).learn(burst)


def test_the_delay_counts_updates_whatever_the_length_of_a_burst(backend: str) -> None:
    """With one update a burst, the original TD3's schedule, the actor must not move at every one."""
    learner = make_learner("td3", "aan", "task", backend, **{"algo.policy_delay": 3})
    moved = []
    for seed in range(7):
        before = learner.actor_updates
        learner.learn(make_burst(seed, count=1))
        moved.append(learner.actor_updates - before)
    assert moved == [1, 0, 0, 1, 0, 0, 1]


def assert_equal(ours: object, theirs: object) -> None:
    if isinstance(ours, dict):
        assert isinstance(theirs, dict) and ours.keys() == theirs.keys()
        for key, value in ours.items():
            assert_equal(value, theirs[key])
    elif isinstance(ours, list):
        assert isinstance(theirs, list)
        for a, b in zip(ours, theirs, strict=True):
            assert_equal(a, b)
    else:
        assert torch.equal(ours, theirs) if isinstance(ours, Tensor) else ours == theirs  # type: ignore[arg-type]


@pytest.mark.parametrize("algo", ["td3", "sac"])
def test_a_learner_restored_from_its_state_goes_on_as_the_first(algo: str, backend: str) -> None:
    """Otherwise a resumed run is another run."""
    first, second = (make_learner(algo, "bptsan", "poisson", backend) for _ in range(2))
    first.learn(make_burst(1))
    state = first.state_dict()
    kept = copy.deepcopy(state)
    second.load_state_dict(state)
    for stream, other in zip(first.streams, second.streams):
        other.set_state(stream.get_state())
    reports = [learner.learn(make_burst(2)) for learner in (first, second)]
    assert reports[0] == reports[1]
    assert_equal(first.state_dict(), second.state_dict())
    assert_equal(state, kept)  # copies: learning on does not change what was saved


@pytest.mark.parametrize("algo", ["td3", "sac"])
def test_health_is_measured_once_a_burst_and_changes_no_number(algo: str, backend: str) -> None:
    learner = make_learner(algo, "bptsan", "deterministic", backend)
    report = learner.learn(make_burst(1))
    for layer in (1, 2, 3):
        assert 0 < report[f"layer{layer}_firing_rate"] < 1
        assert report[f"layer{layer}_gradient_norm"] > 0
    norms = [report[f"layer{layer}_gradient_norm"] for layer in (1, 2, 3)]
    assert report["actor_gradient_norm"] > math.hypot(*norms)  # the decoder learns too
    assert "layer1_firing_rate" not in make_learner(algo, "aan", "task", backend).learn(make_burst(1))


@pytest.mark.parametrize("algo", ["td3", "sac"])
def test_a_parameter_that_is_not_finite_is_named(algo: str, backend: str) -> None:
    learner = make_learner(algo, "aan", "task", backend)
    learner.check_finite()
    with torch.no_grad():
        next(learner.modules["target_critic"].parameters())[0, 0, 0] = torch.nan
    with pytest.raises(Diverged, match="target_critic"):
        learner.check_finite()


class Own(Actor):
    """An actor of a user's own: a recurrent cell, a buffer, a parameter that no pass uses."""

    def __init__(self, observation_size: int, action_size: int, streams: Streams, encoder: None) -> None:
        super().__init__()
        self.cell = nn.GRUCell(observation_size, 8)
        self.head = nn.Linear(8, action_size)
        self.register_buffer("scale", torch.ones(observation_size))
        self.unused = nn.Parameter(torch.zeros(3))

    def forward(self, observation: Tensor, generator: torch.Generator | None = None) -> Tensor:
        state = self.cell(observation * self.scale)
        raw: Tensor = self.head(self.cell(observation, state))
        return raw


def own_actor(algo: str, backend: str = "auto") -> Learner:
    config = make_config({"algo.log_std_network": "separate"} if algo == "sac" else {}, algo=algo, actor="aan")
    own = CustomActorConfig("custom", "own", f"{__name__}.Own", arguments={}, spikes=False, learning_rate=1e-3)
    return build_learner(replace(config, actor=own, backend=backend), N, M, 1.0, Streams(SEED))


@pytest.mark.parametrize("algo", ["td3", "sac"])
def test_an_actor_of_ones_own_learns(algo: str) -> None:
    """By its ``forward`` alone, on the default backend; what no pass uses stays as it is."""
    learner = own_actor(algo)
    assert learner.backend == "plain"
    before = copy.deepcopy(learner.policy.actor)
    learner.learn(make_burst(1))
    learner.check_finite()
    for (name, p), old in zip(learner.policy.actor.named_parameters(), before.parameters(), strict=True):
        assert torch.equal(p, old) == (name == "unused"), name
    state = learner.state_dict()
    own_actor(algo).load_state_dict(state)


def test_the_fast_backend_is_refused_in_one_sentence_where_it_does_not_serve() -> None:
    with pytest.raises(ConfigurationError, match=r"backend: fast does not support actor own .*; use auto or plain"):
        own_actor("td3", "fast")


@pytest.mark.parametrize("actor", ["aan", "bptsan"])
@pytest.mark.parametrize("algo", ["td3", "sac"])
def test_learning_in_double_precision_is_learning_in_single_to_rounding(algo: str, actor: str) -> None:
    """The plain path trains in any precision; noise and keys of a burst are the same in each."""
    single = make_learner(algo, actor, "task")
    parts = copy.deepcopy([single.policy.actor.double(), single.critic.double()])
    streams = UpdateStreams(*(Streams(SEED).torch(name) for name in ("exploration", "noise", "encoder")))
    if isinstance(single, SAC):
        log_std = copy.deepcopy(single.log_std.double())
        double: Learner = SAC(single.config, parts[0], log_std, parts[1], 1.0, streams)  # type: ignore[arg-type]
    else:
        assert isinstance(single, TD3)
        double = TD3(single.config, parts[0], parts[1], 1.0, streams)  # type: ignore[arg-type]
    single = make_learner(algo, actor, "task")
    single.streams = UpdateStreams(*(Streams(SEED).torch(name) for name in ("exploration", "noise", "encoder")))
    burst = make_burst(1, count=3)
    report = single.learn(burst)
    exact = double.learn(Batch(*(x.double() for x in burst)))
    assert report == pytest.approx(exact, rel=1e-3, abs=1e-4)
    for p in double.modules["actor"].parameters():
        assert p.dtype == torch.float64
    actions = double.explore(burst.observation[0].double()), single.explore(burst.observation[0])
    torch.testing.assert_close(actions[0].float(), actions[1], rtol=1e-3, atol=1e-3)


@pytest.mark.skipif(not torch.cuda.is_available(), reason="needs a GPU")
@pytest.mark.parametrize("actor", ["aan", "popsan", "bptsan"])
@pytest.mark.parametrize("algo", ["td3", "sac"])
def test_learning_on_a_gpu_is_learning_on_the_cpu_to_rounding(algo: str, actor: str) -> None:
    cpu, gpu = (make_learner(algo, actor, "task", device=device) for device in ("cpu", "cuda"))
    burst = make_burst(1, count=3)
    report = gpu.learn(Batch(*(x.cuda() for x in burst)))
    assert report == pytest.approx(cpu.learn(burst), rel=1e-2, abs=1e-3)
    assert gpu.act(burst.observation[0].cuda(), Streams(1).torch("evaluation")).device.type == "cuda"
