"""What every kernel is compiled with."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import pytest
import torch
from numba import float32, void
from torch import Tensor

from src.actors.build import build_actor
from src.actors.kernels import disjoint
from src.algorithms.sac import Bounds, tanh_gaussian_vjp
from src.ensemble_mlp import EnsembleMLP
from src.streams import Streams
from tests.actors.configuration import configuration
from tests.actors.vjp import gradients


def test_llvm_knows_that_arrays_do_not_overlap() -> None:
    def add(target, a):
        for j in range(target.shape[0]):
            target[j] = target[j] + a[j]

    compiled = disjoint(add)
    signature = void(float32[::1], float32[::1])
    compiled.compile(signature.args)
    (code,) = compiled.inspect_llvm().values()
    assert "<8 x float>" in code or "<4 x float>" in code or "<16 x float>" in code  # SIMD
    assert "vector.memcheck" not in code  # and no looking for overlaps first


Calls = Callable[[], Sequence[Tensor]]


def an_actor(lateral: str) -> Calls:
    built = build_actor(configuration("bptsan", "deterministic", actor__lateral__weights=lateral), 11, 3, Streams(0))
    observation, to_raw = torch.randn(6, 11), torch.randn(6, 3)

    def calls() -> Sequence[Tensor]:
        with torch.no_grad():
            _, health = built.forward_with_health(observation)
        return [*gradients(built, observation, to_raw), *health.layers[-1]]

    return calls


def a_sample() -> Calls:
    parts, bounds = torch.randn(3, 4, 3), Bounds(-20.0, 2.0, 1.0)

    def calls() -> Sequence[Tensor]:
        action, log_probability, pull = tanh_gaussian_vjp(*parts, bounds)
        return [action, log_probability, *pull(parts[0], parts[1, :, 0])]

    return calls


def critics() -> Calls:
    networks, x = EnsembleMLP([5, 8, 1], 2, Streams(0), "test"), torch.randn(4, 5)
    gradient_of = {p: torch.empty_like(p) for p in networks.parameter_pairs}

    def calls() -> Sequence[Tensor]:
        regressed = networks.regress(x, x[:, 0].contiguous(), gradient_of)
        filled = [gradient.clone() for gradient in gradient_of.values()]
        return [*regressed, *filled, *networks.smallest_output_gradient(x[:, :3], x[:, 3:], -1.0, 2)]

    return calls


@pytest.mark.parametrize("build", [partial(an_actor, "per_neuron"), partial(an_actor, "shared"), a_sample, critics])
def test_kernels_write_to_what_has_the_precision_of_what_they_read(build: Callable[[], Calls]) -> None:
    """Not PyTorch's default: float32 written to where float64 is awaited is garbage, and too long for float16."""
    calls = build()
    expected = calls()
    torch.set_default_dtype(torch.float64)
    try:
        found = calls()
    finally:
        torch.set_default_dtype(torch.float32)
    for ours, theirs in zip(found, expected, strict=True):
        assert ours.dtype == torch.float32 and torch.equal(ours, theirs)
