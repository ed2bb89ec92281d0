"""Kernels of receptive fields and spike coding against the plain functions, bit for bit."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from src.actors.philox import uniform
from src.engine import coding


@pytest.mark.parametrize("count", [1, 3, 4, 5, 511, 2047, 2048, 2049, 11_000])
def test_poisson_spikes_are_philoxs(count):
    key, strength, spikes = 0xFEDC_BA98_7654_3210, torch.rand(count), torch.empty(5, count)
    coding.poisson_spikes(5, count, strength.data_ptr(), key, spikes.data_ptr())
    assert torch.equal(spikes, (uniform(key, 5, count, torch.device("cpu")) < strength).float())


@pytest.mark.parametrize("count", [1, 511, 512, 513, 3000])
def test_deterministic_spikes_are_those_of_the_equation(count):
    strength, spikes, threshold = torch.rand(count), torch.empty(7, count), np.float32(0.999)
    strength[0] = 1.0
    coding.deterministic_spikes(7, count, strength.data_ptr(), threshold, spikes.data_ptr())
    voltage = torch.zeros(count)
    for train in spikes:
        voltage = voltage + strength
        expected = (voltage > float(threshold)).float()
        voltage = voltage - float(threshold) * expected
        assert torch.equal(train, expected)
    assert spikes[:, 0].all()


def test_strengths_that_would_be_denormal_are_zero():
    """As in the plain encoder: an exponential that underflows takes a hundred times as long."""
    observation, mean, std = torch.tensor([[0.0], [13.2], [20.0]]), torch.zeros(1, 1), torch.ones(1, 1)
    distance, strength = torch.empty(3, 1, 1), torch.empty(3, 1, 1)
    addresses = (x.data_ptr() for x in (observation, mean, std, distance, strength))
    coding.field_exponents(3, 1, 1, *addresses)
    strength.exp_()
    coding.zero_underflow(3, strength.data_ptr())
    assert strength.flatten().tolist() == [1.0, pytest.approx(float(np.exp(-(13.2**2) / 2)), rel=1e-3), 0.0]
    assert torch.equal(distance.flatten(), observation.flatten())
