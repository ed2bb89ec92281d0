"""The neurons against an independent loop over the paper's equations, and gradients worked out by hand."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from src.actors.lateral import neighbour_offsets
from src.actors.lif import LIFConstants, LIFState, SpikeSurrogate, lif_step
from src.actors.spiking_layer import unroll

PAPER = LIFConstants(0.5, 0.75, 0.5, 0.5, True, True)


def lif_layer(x, lateral, offsets, constants):
    return unroll(x, LIFState.rest(x[0]), partial(lif_step, lateral=lateral, offsets=offsets, constants=constants))


def loop(x, lateral, offsets, k):
    """The equations of the paper, neuron by neuron, in double precision: spikes and membrane potentials."""
    T, B, n = x.shape
    spikes, potentials = np.zeros((T, B, n)), np.zeros((T, B, n))
    for b in range(B):
        c, v, o = np.zeros(n), np.zeros(n), np.zeros(n)
        for t in range(T):
            before = o.copy()
            for j in range(n):
                intra = sum(
                    lateral[row, j] * before[j + offset]
                    for row, offset in enumerate(offsets)
                    if 0 <= j + offset < n  # nothing beyond the ends of the line
                )
                c[j] = k.current_decay * c[j] + x[t, b, j]
                v[j] = k.voltage_decay * v[j] * (1 - before[j]) + c[j] + intra
                o[j] = 1.0 if v[j] > k.threshold else 0.0
            spikes[t, b], potentials[t, b] = o, v
    return spikes, potentials


def layer(T, B, n, offsets, seed=0):
    """Input currents and lateral weights in double precision."""
    generator = torch.Generator().manual_seed(seed)
    draw = lambda *shape: torch.randn(*shape, generator=generator, dtype=torch.float64)  # noqa: E731
    return draw(T, B, n), 0.3 * draw(len(offsets), n) if offsets else None


def assert_equations(x, lateral, offsets):
    spikes, potentials = lif_layer(x, lateral, offsets, PAPER)
    rows = np.zeros((0, x.shape[2])) if lateral is None else lateral.numpy()
    expected_spikes, expected_potentials = loop(x.numpy(), rows, offsets, PAPER)
    np.testing.assert_allclose(potentials.numpy(), expected_potentials, atol=1e-12)
    np.testing.assert_array_equal(spikes.numpy(), expected_spikes)
    return spikes


@pytest.mark.parametrize("offsets", [(), (-2, -1, 1, 2), (-1, 0, 1)])
def test_equations(offsets):
    """If it fails, the layer does not compute the paper's equations."""
    spikes = assert_equations(*layer(5, 3, 9, offsets), offsets)
    assert 0.1 < spikes.mean() < 0.9


@settings(max_examples=30, deadline=None)
@given(st.integers(1, 7), st.integers(1, 5), st.integers(1, 20), st.integers(0, 6), st.integers(0, 999))
def test_equations_everywhere(T, B, n, radius, seed):
    """Radii beyond the layer's width, single neurons, single steps."""
    offsets = neighbour_offsets(radius, include_self=seed % 2 == 0) if radius else ()
    assert_equations(*layer(T, B, n, offsets, seed), offsets)


@pytest.mark.parametrize(("v", "spike", "gradient"), [
    (0.0, 0, 0), (1.0, 1, 0), (0.5, 0, 1), (-0.25, 0, 0), (0.25, 0, 1), (0.75, 1, 1), (1.25, 1, 0),
])  # fmt: skip
def test_edges(v, spike, gradient):
    """Threshold and surrogate window are strict: v = v_th is silent, v = 0 and v = 1 pass no gradient."""
    x = torch.full((1, 1, 1), v, requires_grad=True)
    spikes, _ = lif_layer(x, None, (), PAPER)
    spikes.sum().backward()
    assert spikes.item() == spike
    assert x.grad.item() == gradient


def test_the_surrogate_gradient_is_that_of_the_clipped_ramp():
    """In double precision, by finite differences of ``clip(v - v_th, -w, w)``, whose slope is the rectangle."""
    v = torch.linspace(-0.43, 1.41, 40, dtype=torch.float64, requires_grad=True)
    ramp = lambda v: (v - 0.5).clamp(-0.4, 0.4)  # noqa: E731
    slope = (ramp(v + 1e-6) - ramp(v - 1e-6)).detach() / 2e-6
    (gradient,) = torch.autograd.grad(SpikeSurrogate.apply(v, 0.5, 0.4).sum(), v)
    torch.testing.assert_close(gradient, slope)
    assert gradient.unique().tolist() == [0, 1]


def test_gradient_by_hand():
    """Two steps of one neuron: current and voltage decay, and the reset's own gradient."""
    x = torch.tensor([0.6, 0.3]).reshape(2, 1, 1).requires_grad_()  # v1 = 0.6 fires; v2 = 0.3 + 0.3 = 0.6 fires
    lif_layer(x, None, (), PAPER)[0][1].sum().backward()
    # do2/dx2 = 1; dv2/dx1 = d_c + d_v (1 - o1) - d_v v1 = 0.5 + 0 - 0.45
    np.testing.assert_allclose(x.grad.flatten().numpy(), [0.05, 1.0], rtol=1e-6)


def test_reset_without_gradient():
    x = torch.tensor([0.6, 0.3]).reshape(2, 1, 1).requires_grad_()
    lif_layer(x, None, (), PAPER._replace(reset_gradient=False))[0][1].sum().backward()
    np.testing.assert_allclose(x.grad.flatten().numpy(), [0.5, 1.0], rtol=1e-6)


def test_lateral_ends_and_detached_spikes():
    """Neuron 0 excites its right neighbour only; without ``lateral_gradient`` the weight still learns."""
    for through in (True, False):
        x = torch.zeros(2, 1, 3)
        x[0, 0, 0] = 0.6
        x.requires_grad_()
        lateral = torch.tensor([[0.3, 0.3, 0.3], [0.2, 0.2, 0.2]], requires_grad=True)  # offsets -1, 1
        constants = PAPER._replace(lateral_gradient=through)
        spikes, potentials = lif_layer(x, lateral, (-1, 1), constants)
        # c of neuron 0 at step 2 is 0.3; neuron 1 hears neuron 0 through its weight for offset -1
        np.testing.assert_allclose(potentials[1, 0].detach().numpy(), [0.3, 0.3, 0.0], rtol=1e-6)
        spikes[1, 0, 1].backward()
        np.testing.assert_allclose(lateral.grad.numpy(), [[0, 1, 0], [0, 0, 0]])
        np.testing.assert_allclose(x.grad[0, 0].numpy(), [0.3 if through else 0.0, 1.25, 0.0])
