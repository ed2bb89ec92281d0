"""The learners against naive loops of torch.nn, torch.optim and deep copies: is the update the one that is stated?"""

from __future__ import annotations

import copy
import math

import pytest
import torch
from torch import Tensor, nn

from src.algorithms.build import build_learner
from src.algorithms.critic import TwinCritic
from src.algorithms.learner import Learner, Minibatches
from src.algorithms.metrics import Diverged
from src.algorithms.sac_learner import SACLearner
from src.algorithms.td3 import target_groups
from src.algorithms.td3_learner import TD3Learner
from src.streams import Streams
from tests.helpers import make_config

N, M, SEED = 5, 3, 3
SMALL = {"actor.hidden_sizes": [32, 32], "algo.critic_hidden_sizes": [32, 32]}


def make_learner(algo: str, actor: str, encoder: str, **overrides: object) -> Learner:
    return build_learner(
        make_config(SMALL | overrides, algo=algo, actor=actor, encoder=encoder), N, M, 1.0, Streams(SEED)
    )


def make_burst(seed: int, count: int = 7, batch: int = 20) -> Minibatches:
    g = torch.Generator().manual_seed(seed)
    return Minibatches(
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
def test_td3_is_spinning_ups_loop(actor: str, encoder: str, delay: int) -> None:
    learner = make_learner("td3", actor, encoder, **{"algo.policy_delay": delay})
    assert isinstance(learner, TD3Learner)
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
        report = learner.update(burst)
        assert report["actor_loss"] == pytest.approx(float(torch.stack(actor_losses).mean()), rel=1e-3, abs=1e-4)
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
def test_sac_is_spinning_ups_loop(actor: str, encoder: str) -> None:
    learner = make_learner("sac", actor, encoder)
    assert isinstance(learner, SACLearner)
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
    report = learner.update(burst)
    expected = torch.stack(recorded).mean(0).tolist()
    assert [report["actor_loss"], report["log_probability"]] == pytest.approx(expected, rel=1e-3, abs=1e-4)
    assert_same(learner.policy.actor, pi)
    assert_same(learner.log_std, log_std, tolerance=2e-4)
    assert_same(NaiveCritics(learner.critic), q)
    assert_same(NaiveCritics(learner.target_critic), target_q)


def test_td3_explores_with_the_stated_noise_inside_the_action_limit() -> None:
    learner = make_learner("td3", "aan", "task")
    observation = torch.zeros(1, N).expand(20_000, N)
    difference = learner.explore(observation) - learner.policy(observation)
    assert float(difference.std()) == pytest.approx(0.1, rel=0.05)
    learner.policy.actor.output.biases[0].data.fill_(50.0)  # tanh saturates at the limit
    assert float(learner.explore(observation).max()) <= 1.0


@pytest.mark.parametrize("limit", [0.4, 3.0])
def test_noise_is_in_units_of_the_action_limit(limit: float) -> None:
    """Absolute noise would be half of the range of a task with limit 0.4, and nothing at limit 3."""
    config = make_config(SMALL, algo="td3", actor="aan", encoder="task")
    learner = build_learner(config, N, M, limit, Streams(SEED))
    observation = torch.zeros(1, N).expand(20_000, N)
    difference = learner.explore(observation) - learner.policy(observation)
    assert float(difference.std()) == pytest.approx(0.1 * limit, rel=0.05)
    seen = []
    learner.target_critic.forward = lambda observation, action: seen.append(action) or torch.zeros(2, len(action))
    burst = make_burst(1, count=1, batch=20_000)
    learner.update(burst)
    smoothing = seen[0] - learner.target_policy(burst.next_observation[0])
    assert float(smoothing.abs().max()) == pytest.approx(0.5 * limit, rel=0.02)
    assert 0.15 * limit < float(smoothing.std()) < 0.2 * limit


def test_sigma_is_projected_after_an_actor_step() -> None:
    learner = make_learner("td3", "popsan", "deterministic")
    with torch.no_grad():
        learner.policy.actor.encoder.std.fill_(1e-9)
    learner.update(make_burst(1, count=1))
    assert float(learner.policy.actor.encoder.std.min()) >= 1e-3 - 1e-9


@pytest.mark.parametrize("algo", ["td3", "sac"])
def test_a_loss_that_is_not_finite_ends_the_burst(algo: str) -> None:
    burst = make_burst(1)
    burst.reward[3, 5] = torch.inf
    with pytest.raises(Diverged, match="critic_loss"):
        make_learner(algo, "aan", "task").update(burst)


@pytest.mark.parametrize("first,count,delay", [(0, 7, 2), (100, 50, 2), (3, 5, 1), (50, 8, 3), (1, 1, 4), (4, 1, 4)])
def test_a_group_of_targets_ends_with_the_update_that_moves_them(first: int, count: int, delay: int) -> None:
    groups = list(target_groups(first, count, delay))
    assert [index for group in groups for index in group] == list(range(count))
    assert all((first + group[-1]) % delay == 0 for group in groups[:-1])
    assert not any((first + index) % delay == 0 for group in groups for index in group[:-1])


def test_the_delay_counts_updates_whatever_the_length_of_a_burst() -> None:
    """With one update a burst, the original TD3's schedule, the actor must not move at every one."""
    learner = make_learner("td3", "aan", "task", **{"algo.policy_delay": 3})
    moved = []
    for seed in range(7):
        before = learner.actor_updates
        learner.update(make_burst(seed, count=1))
        moved.append(learner.actor_updates - before)
    assert moved == [1, 0, 0, 1, 0, 0, 1]
