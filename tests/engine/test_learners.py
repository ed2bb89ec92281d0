"""A fast learner against the plain one over bursts: values, parameters, targets, moments, counters and streams."""

from __future__ import annotations

import pytest
import torch

from src.algorithms.build import build_learner
from src.algorithms.learner import Batch
from src.streams import Streams
from tests.helpers import make_config

N, M, LIMIT = 5, 3, 0.7
SMALL = {"actor.hidden_sizes": [32, 24], "algo.critic_hidden_sizes": [32, 24]}
CASES = [("aan", "task"), ("popsan", "deterministic"), ("bptsan", "poisson"), ("bptsan_wo_li", "deterministic")]


def learners(algo, actor, encoder, **overrides):
    found = []
    for backend in ("fast", "plain"):
        config = make_config(SMALL | overrides | {"backend": backend}, algo=algo, actor=actor, encoder=encoder)
        found.append(build_learner(config, N, M, LIMIT, Streams(3)))
        assert found[-1].backend == backend
    return found


def burst(seed, count=7, batch=20):
    generator = torch.Generator().manual_seed(seed)
    return Batch(
        torch.randn(count, batch, N, generator=generator).clamp(-3, 3),
        (torch.rand(count, batch, M, generator=generator) * 2 - 1) * LIMIT,
        torch.randn(count, batch, generator=generator),
        torch.randn(count, batch, N, generator=generator).clamp(-3, 3),
        (torch.rand(count, batch, generator=generator) < 0.3).float(),
    )


def moments(learner, name):
    """Adam's first moments of a part's parameters, in their order."""
    optimizer = learner.optimizers[name]
    if learner.backend == "plain":
        return [optimizer.state[p]["exp_avg"] for group in optimizer.param_groups for p in group["params"]]
    flat = learner.flat[name]
    starts = [(p.data_ptr() - flat.values.data_ptr()) // 4 for p in flat.parameters]
    return [optimizer.first_moment[i : i + p.numel()].view(p.shape) for i, p in zip(starts, flat.parameters)]


@pytest.mark.parametrize("algo", ["td3", "sac"])
@pytest.mark.parametrize("actor,encoder", CASES)
def test_bursts_leave_what_the_plain_learner_leaves(algo, actor, encoder):
    fast, plain = learners(algo, actor, encoder)
    for seed in (1, 2):  # of odd length: TD3's delay goes on over the second
        reports = [learner.learn(burst(seed)) for learner in (fast, plain)]
        assert reports[0].keys() == reports[1].keys()
        for key, value in reports[1].items():
            assert reports[0][key] == pytest.approx(value, rel=1e-2, abs=1e-3), key
    assert (fast.critic_updates, fast.actor_updates) == (plain.critic_updates, plain.actor_updates)
    for name, module in plain.modules.items():
        for (key, ours), theirs in zip(fast.modules[name].named_parameters(), module.parameters(), strict=True):
            torch.testing.assert_close(
                ours, theirs, rtol=0, atol=5e-5, msg=lambda text, name=name, key=key: f"{name}.{key}: {text}"
            )
    for name in plain.optimizers:
        for ours, theirs in zip(moments(fast, name), moments(plain, name), strict=True):
            torch.testing.assert_close(ours, theirs, rtol=1e-2, atol=1e-3 * float(theirs.abs().max()) + 1e-9)
    for stream in ("exploration", "update_noise", "encoder"):
        ours, theirs = getattr(fast.streams, stream), getattr(plain.streams, stream)
        assert torch.equal(ours.get_state(), theirs.get_state()), stream


@pytest.mark.parametrize("algo", ["td3", "sac"])
@pytest.mark.parametrize("actor,encoder", CASES)
def test_both_act_and_explore_alike(algo, actor, encoder):
    """Also after a burst: what is derived from the parameters for acting has to follow them."""
    fast, plain = learners(algo, actor, encoder)
    for learner in (fast, plain):
        learner.learn(burst(1, count=3))
    observation = torch.randn(9, N)
    generators = [torch.Generator().manual_seed(5) for _ in range(2)]
    acted = [learner.act(observation, generator) for learner, generator in zip((fast, plain), generators)]
    torch.testing.assert_close(*acted, rtol=0, atol=2e-3)
    torch.testing.assert_close(fast.explore(observation), plain.explore(observation), rtol=0, atol=2e-3)
    assert torch.equal(fast.streams.encoder.get_state(), plain.streams.encoder.get_state())


@pytest.mark.parametrize("algo", ["td3", "sac"])
@pytest.mark.parametrize("actor,encoder", CASES)
def test_a_restored_learner_goes_on_as_the_old_one(algo, actor, encoder):
    whole, _ = learners(algo, actor, encoder)
    half, _ = learners(algo, actor, encoder)
    whole.learn(burst(1))
    half.learn(burst(1))
    restored, _ = learners(algo, actor, encoder)
    restored.load_state_dict(half.state_dict())
    for stream in ("exploration", "update_noise", "encoder"):
        getattr(restored.streams, stream).set_state(getattr(half.streams, stream).get_state())
    observation = torch.randn(4, N)
    acted = [x.act(observation, torch.Generator().manual_seed(1)) for x in (whole, restored)]
    assert torch.equal(*acted)
    assert whole.learn(burst(2)) == restored.learn(burst(2))
    for name, module in whole.modules.items():
        for ours, theirs in zip(restored.modules[name].parameters(), module.parameters(), strict=True):
            assert torch.equal(ours, theirs), name
