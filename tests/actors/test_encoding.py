"""Population encoder and spike coding, against trains worked out by hand."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from src.actors.philox import draw_key, philox, uniform
from src.actors.population_encoder import PopulationEncoder
from src.actors.spike_coding import coding_gradient, encode, poisson_draws
from tests.actors.configuration import configuration


def encoder(**overrides):
    return PopulationEncoder(configuration(**overrides).encoder, observation_size=3, time_steps=5)


@pytest.mark.parametrize(("strength", "train"), [
    (1.0, [1, 1, 1, 1, 1]),  # with threshold 1 and ">" it would miss the first step
    (0.5, [0, 1, 0, 1, 0]),  # 0.5, 1.0 -> 0.001, 0.501, 1.001 -> 0.002, 0.502
    (0.4, [0, 0, 1, 0, 1]),  # 0.4, 0.8, 1.2 -> 0.201, 0.601, 1.001 -> 0.002
    (0.25, [0, 0, 0, 1, 0]),
    (0.999, [0, 1, 1, 1, 1]),  # strictly above
    (0.1, [0, 0, 0, 0, 0]),
])  # fmt: skip
def test_deterministic_trains(strength, train):
    spikes = encode(torch.tensor([[strength]], dtype=torch.float64), "deterministic", 5, 0.999, None)
    assert spikes.flatten().tolist() == train


def test_deterministic_trains_of_a_batch():
    """The voltages of a batch are those of the equations, one after the other."""
    strength = torch.rand(7, 13, generator=torch.Generator().manual_seed(0))
    voltage, expected = torch.zeros_like(strength), []
    for _ in range(5):
        voltage = voltage + strength
        expected.append((voltage > 0.999).float())
        voltage = voltage - 0.999 * expected[-1]
    assert torch.equal(encode(strength, "deterministic", 5, 0.999, None), torch.stack(expected))


def test_deterministic_gradient_through_the_soft_reset():
    """d v'_tau / d A by hand: 1, then (1 - theta) of the step before plus 1."""
    strength = torch.tensor([[0.7, 0.2]], requires_grad=True)
    spikes = encode(strength, "deterministic", 3, 0.9, None)
    (spikes * torch.tensor([1.0, 10.0, 100.0]).reshape(3, 1, 1)).sum().backward()
    np.testing.assert_allclose(strength.grad.numpy(), [[1 + 10 * 1.1 + 100 * 1.11] * 2], rtol=1e-6)


def test_poisson_rate_and_gradient():
    strength = torch.tensor([[0.0, 0.2, 0.7, 1.0]], requires_grad=True)
    spikes = encode(strength, "poisson", 20000, 0.999, torch.Generator().manual_seed(0))
    np.testing.assert_allclose(spikes.mean((0, 1)).detach().numpy(), [0, 0.2, 0.7, 1.0], atol=0.02)
    assert set(spikes.flatten().tolist()) == {0.0, 1.0}
    spikes.sum().backward()
    assert strength.grad.tolist() == [[20000.0] * 4]


@pytest.mark.parametrize(("counter", "key", "words"), [
    ((0, 0, 0, 0), (0, 0), (0x6627E8D5, 0xE169C58D, 0xBC57AC4C, 0x9B00DBD8)),
    ((0xFFFFFFFF,) * 4, (0xFFFFFFFF,) * 2, (0x408F276D, 0x41C83B0E, 0xA20BC7C6, 0x6D5451FD)),
    ((0x243F6A88, 0x85A308D3, 0x13198A2E, 0x03707344), (0xA4093822, 0x299F31D0),
     (0xD16CFE09, 0x94FDCCEB, 0x5001E420, 0x24126EA1)),
])  # fmt: skip
def test_philox_known_answers(counter, key, words):
    """Vectors of Random123 (kat_vectors, philox4x32 10): the numbers are those of the published generator."""
    found = philox(tuple(torch.tensor(word) for word in counter), key[0] | key[1] << 32)
    assert tuple(int(word) for word in found) == words


def test_poisson_spikes_are_where_the_draw_is_below_the_strength():
    """And one pass moves the stream on by one draw, whatever its size."""
    first, second, third = (torch.Generator().manual_seed(1) for _ in range(3))
    for shape in [(1, 1), (3, 1), (7, 13), (100, 110)]:
        strength = torch.rand(shape, generator=torch.Generator().manual_seed(0))
        spikes = encode(strength, "poisson", 5, 0.999, first)
        assert torch.equal(spikes, (poisson_draws(strength, 5, second) < strength).float())
        draw_key(third)
    assert torch.equal(first.get_state(), third.get_state())


def test_uniform_numbers():
    """Flat over [0, 1), and without correlation between neighbours, steps and the words of a counter."""
    u = uniform(draw_key(torch.Generator().manual_seed(0)), 4, 40000, torch.device("cpu"))
    assert 0 <= u.min() < u.max() < 1
    counts = torch.histc(u, 100, 0, 1)
    assert ((counts - 1600).square() / 1600).sum() < 170  # chi-square of 99 degrees: p < 1e-5
    centred = (u - 0.5) * 12**0.5
    for a, b in [
        (centred[:, 1:], centred[:, :-1]),
        (centred[1:], centred[:-1]),
        (centred[:, 10000:], centred[:, :-10000]),
    ]:
        assert abs((a * b).mean()) < 5 / a.numel() ** 0.5
    keys = {draw_key(generator) for generator in [torch.Generator().manual_seed(2)] for _ in range(100)}
    assert len(keys) == 100
    assert max(keys) > 2**63  # all 64 bits


def test_poisson_needs_its_own_stream():
    """Without one it would silently draw from a global generator."""
    with pytest.raises(ValueError, match="generator"):
        encode(torch.rand(1, 4), "poisson", 5, 0.999, None)
    draw = lambda seed: encode(torch.full((8, 8), 0.5), "poisson", 5, 0.999, torch.Generator().manual_seed(seed))  # noqa: E731
    state = torch.get_rng_state()
    assert torch.equal(draw(1), draw(1))
    assert not torch.equal(draw(1), draw(2))
    assert torch.equal(state, torch.get_rng_state())


def test_coding_gradient():
    assert coding_gradient("poisson", 3, 0.999) == [1, 1, 1]
    np.testing.assert_allclose(coding_gradient("deterministic", 3, 0.999), [1, 1.001, 1.001001])


def test_receptive_fields():
    """A = exp(-(s - mu)^2 / (2 sigma^2)), J neurons for each dimension in turn."""
    module = encoder()
    observation = torch.randn(4, 3, generator=torch.Generator().manual_seed(0))
    centres = np.linspace(-3, 3, 10)
    expected = np.exp(-((observation.numpy()[:, :, None] - centres) ** 2) / (2 * 0.15))
    np.testing.assert_allclose(module.strength(observation).detach().numpy(), expected.reshape(4, 30), atol=1e-6)


def test_strengths_that_underflow_are_zero():
    """Not denormal numbers, which take an exponential fifty times as long; and nothing else is touched."""
    module = PopulationEncoder(configuration(encoder__population_size=1).encoder, 1, 5)
    exponents = np.concatenate([np.linspace(-88, -86, 999), [-np.inf, -100, -50, 0, np.nan]])
    with torch.no_grad():
        module.mean.zero_()
        module.std.fill_(0.5**0.5)
        observation = torch.tensor(np.sqrt(-exponents), dtype=torch.float32).unsqueeze(1)
        found = module.strength(observation).flatten().double().numpy()
        exponent = (observation.square() * (-0.5 / module.std.square())).flatten().double().numpy()
    expected, tiny = np.exp(exponent), np.finfo(np.float32).tiny
    np.testing.assert_allclose(found, np.where(expected < tiny, 0, expected), rtol=2e-5)
    assert (found == 0).any() and ((found > 0) & (found < 1e-37)).any() and not ((found > 0) & (found < tiny)).any()


def test_receptive_field_gradients():
    """Those of the equation, an observation far out of every field among them: zero, and a number."""
    module = encoder().double()
    with torch.no_grad():
        module.std.mul_(torch.rand_like(module.std) + 0.5)
    observation = torch.randn(4, 3, dtype=torch.float64)
    observation[0, 0] = 30.0
    observation.requires_grad_()
    weights = torch.randn(4, 30, dtype=torch.float64)
    inputs = (observation, module.mean, module.std)
    plain = torch.exp(-((observation.unsqueeze(-1) - module.mean) ** 2) / (2 * module.std**2)).flatten(1)
    expected = torch.autograd.grad((plain * weights).sum(), inputs)
    found = torch.autograd.grad((module.strength(observation) * weights).sum(), inputs)
    for grad, correct in zip(found, expected, strict=True):
        torch.testing.assert_close(grad, correct)


def test_sigma_floor():
    """PopSAN leaves sigma free: at 0 the strength is NaN."""
    module = encoder()
    with torch.no_grad():
        module.std[0, 0], module.std[0, 1] = -1.0, 0.0
        module.std[1, 0] = 0.2
    module.project()
    assert module.std.min().item() == pytest.approx(1e-3)
    assert module.std[1, 0].item() == pytest.approx(0.2)
    assert torch.isfinite(module.strength(torch.zeros(1, 3))).all()


def test_fixed_receptive_fields():
    module = encoder(encoder__learnable=False)
    assert list(module.parameters()) == []
    assert list(module.state_dict()) == []
    module.project()
    assert not module(torch.randn(2, 3)).requires_grad


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_deterministic_threshold_is_strict(dtype):
    strength = torch.tensor([[0.75, 0.7500001]], dtype=dtype)
    assert encode(strength, "deterministic", 1, 0.75, None).flatten().tolist() == [0, 1]


@pytest.mark.parametrize("shape", [(7, 2), (3,), (7, 1), (2, 7, 3)])
def test_observations_of_another_size_are_refused(shape):
    """One column would be broadcast to all dimensions in silence."""
    with pytest.raises(ValueError, match=r"takes observations \[B, 3\]"):
        encoder().strength(torch.zeros(shape))
