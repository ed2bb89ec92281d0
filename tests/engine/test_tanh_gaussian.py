"""The squashed Gaussian's kernel against the plain function and autograd."""

from __future__ import annotations

import pytest
import torch

from src.algorithms import sac
from src.engine import tanh_gaussian

LOW, HIGH, LIMIT = -20.0, 2.0, 0.4


def plain(mean, log_std, noise):
    return sac.tanh_gaussian(mean, log_std, noise, sac.Bounds(LOW, HIGH, LIMIT))


@pytest.mark.parametrize("scale", [0.1, 1.0, 10.0])
def test_samples_and_gradients_are_autograds(scale):
    mean, log_std = scale * torch.randn(30, 4), torch.randn(30, 4)
    log_std[0], log_std[1] = 3.0, -21.0  # out of its bounds
    noise, grad_action, grad_log_probability = torch.randn(30, 4), torch.randn(30, 4), torch.randn(30)
    drawn = tanh_gaussian.sample(mean, log_std, noise, (LOW, HIGH, LIMIT))
    inputs = (mean.requires_grad_(), log_std.requires_grad_())
    outputs = plain(*inputs, noise)
    torch.testing.assert_close(drawn.action, outputs[0].detach(), rtol=1e-5, atol=1e-6)
    torch.testing.assert_close(drawn.log_probability, outputs[1].detach(), rtol=1e-5, atol=1e-4)
    expected = torch.autograd.grad(outputs, inputs, [grad_action, grad_log_probability])
    found = tanh_gaussian.gradient(drawn, grad_action, grad_log_probability, (LOW, HIGH, LIMIT))
    for ours, theirs in zip(found, expected, strict=True):
        torch.testing.assert_close(ours, theirs, rtol=1e-3, atol=1e-3)
    assert not found[1][:2].any()


def test_nan_propagates():
    nan = torch.full((2, 3), torch.nan)
    drawn = tanh_gaussian.sample(nan, torch.zeros(2, 3), torch.zeros(2, 3), (LOW, HIGH, LIMIT))
    assert drawn.action.isnan().all() and drawn.log_probability.isnan().all()
