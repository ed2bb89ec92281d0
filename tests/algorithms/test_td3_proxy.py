"""TD3 with a proxy target against a naive loop of torch.nn, torch.optim and deep copies."""

from __future__ import annotations

import copy
from dataclasses import replace

import pytest
import torch
from torch import Tensor, nn

from src.algorithms.build import build_learner
from src.algorithms.td3_proxy import TD3Proxy, proxy_loss
from src.config.schema import ConfigurationError
from src.streams import Streams
from tests.algorithms.test_learners import (
    SEED,
    SMALL,
    M,
    N,
    NaiveCritics,
    assert_same,
    make_burst,
    make_learner,
    polyak,
    step,
)
from tests.helpers import make_config

SIZES = {"algo.proxy_hidden_sizes": [16, 16]}


def network_of(proxy: nn.Module) -> nn.Sequential:
    """The proxy from torch.nn.Linear."""
    layers: list[nn.Module] = []
    for weight, bias in zip(proxy.network.weights, proxy.network.biases):
        linear = nn.Linear(weight.shape[1], weight.shape[2])
        linear.weight.data, linear.bias.data = weight.detach()[0].T.clone(), bias.detach()[0, 0].clone()
        layers += [linear, nn.ReLU()]
    return nn.Sequential(*layers[:-1])


@pytest.mark.parametrize(
    ("actor", "encoder", "k"), [("popsan", "poisson", 3), ("bptsan", "deterministic", 1), ("aan", "task", 2)]
)
def test_it_is_the_papers_loop(actor: str, encoder: str, k: int) -> None:
    """K steps of imitation, then the critics on the last of these minibatches, then every second time the actor."""
    learner = make_learner("td3_proxy", actor, encoder, **SIZES, **{"algo.proxy_steps": k})
    assert isinstance(learner, TD3Proxy) and learner.minibatches_per_update == k
    pi, q, proxy = (
        copy.deepcopy(learner.policy.actor),
        NaiveCritics(learner.critic),
        network_of(learner.modules["proxy"]),
    )
    target_q = copy.deepcopy(q)
    draws, smoothing = Streams(SEED).torch("encoder"), Streams(SEED).torch("target noise")
    actor_adam = torch.optim.Adam(pi.parameters(), lr=learner.config.actor_learning_rate)
    critic_adam = torch.optim.Adam(q.parameters(), lr=1e-3)
    proxy_adam = torch.optim.Adam(proxy.parameters(), lr=1e-3)
    updates = 0
    for burst in (make_burst(1, 3 * k), make_burst(2, 3 * k)):
        noise = 0.2 * torch.randn((3, *burst.action.shape[1:]), generator=smoothing)
        losses: list[Tensor] = []
        for update in range(3):
            for i in range(update * k, update * k + k):
                o = burst.observation[i]
                with torch.no_grad():
                    action = torch.tanh(pi(o, draws))
                losses.append(((torch.tanh(proxy(o)) - action) ** 2).sum() / action.numel())
                step(proxy_adam, losses[-1])
            a, r, o2, d = burst.action[i], burst.reward[i], burst.next_observation[i], burst.terminated[i]
            with torch.no_grad():
                a2 = (torch.tanh(proxy(o2)) + noise[update].clamp(-0.5, 0.5)).clamp(-1, 1)
                y = r + 0.99 * (1 - d) * torch.min(*target_q(o2, a2))
            step(critic_adam, sum(((value - y) ** 2).mean() for value in q(o, a)))  # type: ignore[arg-type]
            if updates % 2 == 0:
                step(actor_adam, -q(o, torch.tanh(pi(o, draws)))[0].mean())
                pi.project()
                polyak(target_q, q)
            updates += 1
        report = learner.learn(burst)
        assert report["proxy_loss"] == pytest.approx(float(torch.stack(losses).mean()), rel=1e-4)
    assert_same(learner.policy.actor, pi)
    assert_same(NaiveCritics(learner.critic), q)
    assert_same(NaiveCritics(learner.target_critic), target_q)
    assert_same(network_of(learner.modules["proxy"]), proxy)
    assert (learner.critic_updates, learner.actor_updates) == (6, 3)


def test_the_mean_runs_over_batch_and_actions() -> None:
    assert float(proxy_loss(torch.zeros(2, 3), torch.tensor([[6.0, 0, 0], [0, 0, 0]]))) == 6.0


def test_its_state_is_in_the_checkpoint_and_the_target_actor_is_gone() -> None:
    learner = make_learner("td3_proxy", "aan", "task", **SIZES)
    learner.learn(make_burst(1, 6))
    state = learner.state_dict()
    assert set(state["modules"]) == {"actor", "critic", "target_critic", "proxy"}
    other = make_learner("td3_proxy", "aan", "task", **SIZES)
    other.load_state_dict(state)
    other.streams.update_noise.set_state(learner.streams.update_noise.get_state())
    for each in (learner, other):
        each.learn(make_burst(2, 6))
    assert_same(learner.modules["proxy"], other.modules["proxy"], tolerance=0)
    assert_same(learner.policy, other.policy, tolerance=0)


def test_actor_and_critics_begin_as_td3s() -> None:
    proxy, plain = make_learner("td3_proxy", "aan", "task", **SIZES), make_learner("td3", "aan", "task")
    assert_same(proxy.policy, plain.policy, tolerance=0)
    assert_same(proxy.critic, plain.critic, tolerance=0)


def test_the_engine_does_not_serve_it_and_says_so() -> None:
    config = make_config(SMALL | SIZES, algo="td3_proxy", actor="popsan")
    assert build_learner(config, N, M, 1.0, Streams(SEED)).backend == "plain"  # auto
    with pytest.raises(ConfigurationError, match=r"fast does not support algo td3_proxy .*no proxy target"):
        build_learner(replace(config, backend="fast"), N, M, 1.0, Streams(SEED))
