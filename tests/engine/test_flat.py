"""Flat parameters and Adam: if these fail, the fast path's optimizer is not PyTorch's."""

from __future__ import annotations

import pytest
import torch
from torch import nn

from src.engine.flat import FlatAdam, FlatParameters


def test_parameters_are_views_of_one_tensor_each_at_a_cache_line():
    module = nn.Sequential(nn.Linear(5, 7), nn.Linear(7, 3))
    values = [p.detach().clone() for p in module.parameters()]
    flat = FlatParameters(module.parameters())
    for p, value in zip(module.parameters(), values, strict=True):
        assert torch.equal(p, value) and p.data_ptr() % 64 == 0
        assert p.grad.data_ptr() % 64 == 0
    flat.values.mul_(2)
    assert all(torch.equal(p, 2 * value) for p, value in zip(module.parameters(), values))


def test_adam_is_torchs_bit_for_bit():
    module = nn.Linear(50, 32)  # as many numbers as fill cache lines: the tail of a tensor may round otherwise
    theirs = nn.Parameter(torch.cat([p.detach().reshape(-1) for p in module.parameters()]))
    flat = FlatParameters([nn.Parameter(theirs.detach().clone())])
    ours, reference = FlatAdam(flat, 1e-3), torch.optim.Adam([theirs], lr=1e-3, fused=True)
    for _ in range(20):
        theirs.grad = torch.randn_like(theirs)
        flat.gradient[: theirs.numel()] = theirs.grad
        ours.step()
        reference.step()
    assert torch.equal(flat.values[: theirs.numel()], theirs)
    state = reference.state[theirs]
    assert torch.equal(ours.first_moment[: theirs.numel()], state["exp_avg"])
    assert torch.equal(ours.second_moment[: theirs.numel()], state["exp_avg_sq"])


def test_a_restored_optimizer_goes_on_as_the_old_one():
    def steps(optimizer, flat, seeds):
        for seed in seeds:
            flat.gradient.copy_(torch.randn(flat.gradient.shape, generator=torch.Generator().manual_seed(seed)))
            optimizer.step()

    start = torch.randn(32)
    whole = FlatParameters([nn.Parameter(start.clone())])
    steps(FlatAdam(whole, 1e-2), whole, range(6))
    half = FlatParameters([nn.Parameter(start.clone())])
    first = FlatAdam(half, 1e-2)
    steps(first, half, range(3))
    second = FlatAdam(half, 1e-2)
    second.load_state_dict(first.state_dict())
    steps(second, half, range(3, 6))
    assert torch.equal(half.values, whole.values)


@pytest.mark.parametrize("moved", ["data", "grad"])
def test_parameters_that_were_moved_after_binding_are_refused(moved):
    """The kernels write to addresses: they would go on learning somewhere else, in silence."""
    module = nn.Linear(5, 7)
    flat = FlatParameters(module.parameters())
    flat.check()
    setattr(module.weight, moved, getattr(module.weight, moved).clone())
    with pytest.raises(RuntimeError, match="backend=plain"):
        flat.check()
