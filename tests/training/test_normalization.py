"""Every network sees the world through this map: it must be NumPy's mean and variance, and the same after a resume."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from src.training.normalization import Normalizer


def blocks(seed: int, lengths: list[int], size: int, offset: float, scale: float) -> list[np.ndarray]:
    random = np.random.default_rng(seed)
    return [(offset + scale * random.standard_normal((n, size)) ** 3).astype(np.float32) for n in lengths]


@settings(deadline=None, max_examples=60)
@given(
    seed=st.integers(0, 2**32 - 1),
    lengths=st.lists(st.integers(1, 80), min_size=1, max_size=12),
    size=st.integers(1, 7),
    offset=st.floats(-1e3, 1e3),
    scale=st.floats(1e-3, 1e3),
)
def test_it_is_numpys_two_pass_mean_and_variance(
    seed: int, lengths: list[int], size: int, offset: float, scale: float
) -> None:
    data = blocks(seed, lengths, size, offset, scale)
    normalizer = Normalizer(size, clip=3.0)
    for piece in data:
        normalizer.update(torch.from_numpy(piece))
    everything = np.concatenate(data).astype(np.float64)
    mean, variance = everything.mean(0), everything.var(0)
    np.testing.assert_allclose(normalizer.mean.numpy(), mean, rtol=1e-12, atol=1e-12 * (abs(offset) + scale))
    np.testing.assert_allclose(normalizer.variance.numpy(), variance, rtol=1e-9, atol=1e-12)
    expected = np.clip((data[0] - mean) / np.sqrt(variance + 1.2e-7), -3, 3)
    found = normalizer.normalize(torch.from_numpy(data[0]))
    assert found.dtype == torch.float32
    tolerance = 1e-5 + 4 * np.finfo(np.float32).eps * np.max(np.abs(everything) / np.sqrt(variance + 1.2e-7))
    np.testing.assert_allclose(found.numpy(), expected, atol=tolerance)


def test_population_variance_of_a_single_observation_is_zero() -> None:
    normalizer = Normalizer(2, clip=3.0)
    normalizer.update(torch.tensor([[1.0, -5.0]]))
    assert normalizer.variance.tolist() == [0.0, 0.0] and normalizer.mean.tolist() == [1.0, -5.0]
    assert normalizer.normalize(torch.tensor([1.0, -5.0])).tolist() == [0.0, 0.0]


def test_constant_zeros_stay_zero() -> None:
    """ant_zero_contact pads with them; a division by their variance must not blow up."""
    normalizer = Normalizer(3, clip=3.0)
    for _ in range(100):
        normalizer.update(torch.zeros(50, 3))
    assert normalizer.normalize(torch.zeros(4, 3)).tolist() == torch.zeros(4, 3).tolist()


def test_it_clips_on_both_sides() -> None:
    normalizer = Normalizer(1, clip=2.0)
    normalizer.update(torch.randn(1000, 1, generator=torch.Generator().manual_seed(0)))
    assert normalizer.normalize(torch.tensor([[1e9], [-1e9]])).flatten().tolist() == [2.0, -2.0]


def test_before_the_first_block_it_only_clips() -> None:
    observation = torch.tensor([0.5, -7.0])
    torch.testing.assert_close(Normalizer(2, 3.0).normalize(observation), torch.tensor([0.5, -3.0]))


@pytest.mark.parametrize("shape", [(11,), (10, 11), (50, 100, 11)])
def test_any_leading_shape_and_the_input_stays(shape: tuple[int, ...]) -> None:
    normalizer = Normalizer(11, 3.0)
    normalizer.update(torch.randn(50, 11, generator=torch.Generator().manual_seed(0)) * 4 + 1)
    observation = torch.randn(shape, generator=torch.Generator().manual_seed(1))
    copy = observation.clone()
    found = normalizer.normalize(observation)
    assert found.shape == shape and torch.equal(observation, copy)
    rows, single = observation.reshape(-1, 11), found.reshape(-1, 11)
    assert torch.equal(single[-1], normalizer.normalize(rows[-1])), "acting and learning see different worlds"


def test_a_resumed_normalizer_continues_bit_for_bit() -> None:
    pieces = [torch.from_numpy(piece) for piece in blocks(0, [50] * 20, 17, 3.0, 2.0)]
    straight, stopped = Normalizer(17, 3.0), Normalizer(17, 3.0)
    for piece in pieces[:10]:
        straight.update(piece), stopped.update(piece)
    resumed = Normalizer(17, 3.0)
    resumed.load_state_dict(stopped.state_dict())
    stopped.update(pieces[0])  # the saved state is a copy
    for piece in pieces[10:]:
        straight.update(piece), resumed.update(piece)
    assert torch.equal(straight.normalize(pieces[3]), resumed.normalize(pieces[3]))
    assert torch.equal(straight.mean, resumed.mean) and torch.equal(straight.variance, resumed.variance)
    assert straight.count == resumed.count == 1000


def test_disabled_it_is_the_identity() -> None:
    normalizer = Normalizer(3, 3.0, enabled=False)
    observation = torch.tensor([100.0, -100.0, 0.1])
    normalizer.update(observation[None])
    assert torch.equal(normalizer.normalize(observation), observation)


def test_a_state_of_another_size_is_refused() -> None:
    with pytest.raises(ValueError, match="mean has shape"):
        Normalizer(3, 3.0).load_state_dict(Normalizer(4, 3.0).state_dict())
