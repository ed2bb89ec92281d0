"""The spiking layer against an independent loop, and the fused kernel against the reference."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from src.actors import kernels, lif_kernel
from src.actors.lateral import neighbour_offsets
from src.actors.lif import LIFConstants, lif_reference, maxout
from src.actors.lif_op import lif

ROOT = Path(__file__).parents[2]
PAPER = LIFConstants(0.5, 0.75, 0.5, 0.5, True, True)


def loop(z, bias, lateral, offsets, branches, k):
    """The equations of the paper, neuron by neuron, in double precision: spikes and membrane potentials."""
    T, B, width = z.shape
    n = width // branches
    spikes, potentials = np.zeros((T, B, n)), np.zeros((T, B, n))
    for b in range(B):
        c, v, o = np.zeros(n), np.zeros(n), np.zeros(n)
        for t in range(T):
            before = o.copy()
            for j in range(n):
                inter = max(z[t, b, m * n + j] for m in range(branches)) + bias[j]
                intra = sum(
                    lateral[row, j] * before[j + offset]
                    for row, offset in enumerate(offsets)
                    if 0 <= j + offset < n  # nothing beyond the ends of the line
                )
                c[j] = k.current_decay * c[j] + inter
                v[j] = k.voltage_decay * v[j] * (1 - before[j]) + c[j] + intra
                o[j] = 1.0 if v[j] > k.threshold else 0.0
            spikes[t, b], potentials[t, b] = o, v
    return spikes, potentials


def layer(T, B, n, branches, offsets, seed=0, dtype=torch.float32):
    generator = torch.Generator().manual_seed(seed)
    draw = lambda *shape: torch.randn(*shape, generator=generator, dtype=dtype)  # noqa: E731
    return draw(T, B, branches * n), 0.1 * draw(n), 0.3 * draw(len(offsets), n) if offsets else None


def both(z, bias, lateral, offsets, branches, constants):
    """Outputs and gradients of the fused layer and of the reference, from the same inputs."""
    results = []
    for fused in (True, False):
        leaves = [x.clone().requires_grad_() for x in (z, bias, lateral) if x is not None]
        arguments = (leaves[0], leaves[1], leaves[2] if lateral is not None else None, offsets, branches, constants)
        spikes, potentials = lif(*arguments) if fused else lif_reference(*arguments)[:2]
        weights = torch.randn(spikes.shape, generator=torch.Generator().manual_seed(1))
        spikes.backward(weights)
        results.append((spikes, potentials, [leaf.grad for leaf in leaves]))
    return results


@pytest.mark.parametrize("branches", [1, 2, 3])
@pytest.mark.parametrize("offsets", [(), (-2, -1, 1, 2), (-1, 0, 1)])
def test_equations(branches, offsets):
    """If it fails, the layer does not compute the paper's equations."""
    z, bias, lateral = layer(5, 3, 9, branches, offsets, dtype=torch.float64)
    spikes, potentials, _ = lif_reference(z, bias, lateral, offsets, branches, PAPER)
    rows = np.zeros((0, 9)) if lateral is None else lateral.numpy()
    expected_spikes, expected_potentials = loop(z.numpy(), bias.numpy(), rows, offsets, branches, PAPER)
    np.testing.assert_allclose(potentials.numpy(), expected_potentials, atol=1e-12)
    np.testing.assert_array_equal(spikes.numpy(), expected_spikes)
    assert 0.1 < spikes.mean() < 0.9


@pytest.mark.parametrize("flags", [(True, True), (False, True), (True, False), (False, False)])
@pytest.mark.parametrize("branches", [1, 2, 5])
@pytest.mark.parametrize("offsets", [(), (-2, -1, 1, 2), (-1, 0, 1), tuple(neighbour_offsets(5, False))])
@pytest.mark.parametrize("shape", [(5, 4, 256), (1, 3, 7), (3, 1, 1), (4, 2, 300)])
def test_kernel_equals_reference(shape, offsets, branches, flags):
    """If it fails, training with the kernel is not training with the specification."""
    constants = LIFConstants(0.4, 0.7, 0.5, 0.3, *flags)
    fused, reference = both(*layer(*shape, branches, offsets), offsets, branches, constants)
    assert torch.equal(fused[0], reference[0])
    assert torch.equal(fused[1], reference[1])
    for grad, expected in zip(fused[2], reference[2], strict=True):
        torch.testing.assert_close(grad, expected, rtol=1e-4, atol=1e-5 * float(expected.abs().max()) + 1e-30)


@settings(max_examples=30, deadline=None)
@given(
    st.integers(1, 7), st.integers(1, 5), st.integers(1, 40), st.integers(1, 4), st.integers(0, 6), st.integers(0, 999)
)
def test_kernel_equals_reference_everywhere(T, B, n, branches, radius, seed):
    """Radii beyond the layer's width, single neurons, single steps: nothing is read or written out of bounds."""
    offsets = neighbour_offsets(radius, include_self=seed % 2 == 0) if radius else ()
    fused, reference = both(*layer(T, B, n, branches, offsets, seed), offsets, branches, PAPER)
    assert torch.equal(fused[0], reference[0])
    assert torch.equal(fused[1], reference[1])
    for grad, expected in zip(fused[2], reference[2], strict=True):
        torch.testing.assert_close(grad, expected, rtol=1e-4, atol=1e-5 * float(expected.abs().max()) + 1e-30)


@pytest.mark.parametrize("fused", [True, False])
@pytest.mark.parametrize(("v", "spike", "gradient"), [
    (0.0, 0, 0), (1.0, 1, 0), (0.5, 0, 1), (-0.25, 0, 0), (0.25, 0, 1), (0.75, 1, 1), (1.25, 1, 0),
])  # fmt: skip
def test_edges(fused, v, spike, gradient):
    """Threshold and surrogate window are strict: v = v_th is silent, v = 0 and v = 1 pass no gradient."""
    z = torch.full((1, 1, 1), v, requires_grad=True)
    spikes = (lif if fused else lif_reference)(z, None, None, (), 1, PAPER)[0]
    spikes.sum().backward()
    assert spikes.item() == spike
    assert z.grad.item() == gradient


@pytest.mark.parametrize("fused", [True, False])
def test_gradient_by_hand(fused):
    """Two steps of one neuron: current and voltage decay, and the reset's own gradient."""
    z = torch.tensor([0.6, 0.3]).reshape(2, 1, 1).requires_grad_()  # v1 = 0.6 fires; v2 = 0.3 + 0.3 = 0.6 fires
    (lif if fused else lif_reference)(z, None, None, (), 1, PAPER)[0][1].sum().backward()
    # do2/dz2 = 1; dv2/dz1 = d_c + d_v (1 - o1) - d_v v1 = 0.5 + 0 - 0.45
    np.testing.assert_allclose(z.grad.flatten().numpy(), [0.05, 1.0], rtol=1e-6)


def test_reset_without_gradient():
    z = torch.tensor([0.6, 0.3]).reshape(2, 1, 1).requires_grad_()
    lif(z, None, None, (), 1, PAPER._replace(reset_gradient=False))[0][1].sum().backward()
    np.testing.assert_allclose(z.grad.flatten().numpy(), [0.5, 1.0], rtol=1e-6)


def test_lateral_ends_and_detached_spikes():
    """Neuron 0 excites its right neighbour only; without ``lateral_gradient`` the weight still learns."""
    for through in (True, False):
        z = torch.zeros(2, 1, 3)
        z[0, 0, 0] = 0.6
        z.requires_grad_()
        lateral = torch.tensor([[0.3, 0.3, 0.3], [0.2, 0.2, 0.2]], requires_grad=True)  # offsets -1, 1
        constants = PAPER._replace(lateral_gradient=through)
        spikes, potentials = lif(z, None, lateral, (-1, 1), 1, constants)
        # c of neuron 0 at step 2 is 0.3; neuron 1 hears neuron 0 through its weight for offset -1
        np.testing.assert_allclose(potentials[1, 0].detach().numpy(), [0.3, 0.3, 0.0], rtol=1e-6)
        spikes[1, 0, 1].backward()
        np.testing.assert_allclose(lateral.grad.numpy(), [[0, 1, 0], [0, 0, 0]])
        np.testing.assert_allclose(z.grad[0, 0].numpy(), [0.3 if through else 0.0, 1.25, 0.0])


def test_maxout_identity_and_ties():
    """max(a, b) = (a + b) / 2 + |a - b| / 2; equal branches: the first takes the gradient."""
    a, b = torch.randn(2, 50, 8, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    largest, branch = maxout(torch.stack([a, b], dim=1))
    torch.testing.assert_close(largest, (a + b) / 2 + (a - b).abs() / 2)
    assert torch.equal(branch, (b > a).to(torch.int8))
    z = torch.full((1, 1, 3), 0.6, requires_grad=True)
    lif(z, None, None, (), 3, PAPER)[0].sum().backward()
    assert z.grad.flatten().tolist() == [1, 0, 0]


def test_without_gradient():
    """Acting gives the spikes of training, and nothing is kept for a backward pass."""
    offsets = (-2, -1, 1, 2)
    z, bias, lateral = layer(5, 10, 64, 2, offsets)
    expected = lif(z.clone().requires_grad_(), bias, lateral, offsets, 2, PAPER)[0]
    with torch.no_grad():
        spikes, potentials = lif(z.clone().requires_grad_(), bias, lateral, offsets, 2, PAPER)
    assert torch.equal(spikes, expected)
    assert potentials is None
    assert spikes.grad_fn is None
    assert lif(z, bias, lateral, offsets, 2, PAPER, membrane=True)[1] is not None


def test_non_contiguous():
    z, bias, lateral = layer(5, 6, 32, 2, (-1, 1))
    strided = z.transpose(0, 1).contiguous().transpose(0, 1).requires_grad_()
    assert not strided.is_contiguous()
    spikes = lif(strided, bias, lateral, (-1, 1), 2, PAPER)[0]
    assert torch.equal(spikes, lif_reference(z, bias, lateral, (-1, 1), 2, PAPER)[0])
    spikes.mean(0).sum().backward()  # the gradient comes in expanded
    plain = z.clone().requires_grad_()
    lif_reference(plain, bias, lateral, (-1, 1), 2, PAPER)[0].mean(0).sum().backward()
    torch.testing.assert_close(strided.grad, plain.grad, rtol=1e-5, atol=1e-6)


def test_large_batch():
    z, bias, lateral = layer(2, 4096, 33, 2, (-1, 1))
    assert torch.equal(
        lif(z, bias, lateral, (-1, 1), 2, PAPER)[0], lif_reference(z, bias, lateral, (-1, 1), 2, PAPER)[0]
    )


def test_operator():
    """The registered operator gives what the actors use, differentiates, and can be traced without data."""
    offsets = [-1, 1]
    z, bias, lateral = layer(3, 4, 8, 2, offsets)
    z.requires_grad_()
    spikes, _ = torch.ops.spiking_actor.lif(z, bias, lateral, offsets, 2, *PAPER)
    assert torch.equal(spikes, lif_reference(z, bias, lateral, offsets, 2, PAPER)[0])
    (grad,) = torch.autograd.grad(spikes.sum(), z)
    (expected,) = torch.autograd.grad(lif_reference(z, bias, lateral, offsets, 2, PAPER)[0].sum(), z)
    torch.testing.assert_close(grad, expected, rtol=1e-5, atol=1e-6)
    arguments = (z.detach(), bias, lateral, offsets, 2, *PAPER[:3])
    for name in ("lif_forward", "lif_inference"):
        operator = getattr(torch.ops.spiking_actor, name).default
        torch.library.opcheck(operator, arguments, test_utils=("test_schema", "test_faketensor"))
    kept = torch.ops.spiking_actor.lif_forward(*arguments)
    backward = (torch.ones_like(kept[0]), *kept, lateral, offsets, 2, *PAPER)
    torch.library.opcheck(
        torch.ops.spiking_actor.lif_backward.default, backward, test_utils=("test_schema", "test_faketensor")
    )


def test_other_precision_takes_the_reference():
    z, bias, lateral = layer(3, 2, 5, 2, (-1, 1), dtype=torch.float64)
    spikes = lif(z, bias, lateral, (-1, 1), 2, PAPER)[0]
    assert spikes.dtype == torch.float64


def test_machine_without_a_writable_cache(monkeypatch):
    """Numba refuses to compile with a cache that it cannot write; we compile without one."""
    from numba.core import caching

    def refuse(self):
        raise OSError("read-only file system")

    monkeypatch.setattr(caching._CacheLocator, "ensure_cache_path", refuse)

    def double(row):
        for j in range(row.shape[0]):
            row[j] = 2 * row[j]

    row = np.ones(3, np.float32)
    kernels.compiled(double, lif_kernel.void(lif_kernel._ROW))(row)
    assert row.tolist() == [2, 2, 2]


def test_kernels_are_cached_on_disk(tmp_path):
    """A second process loads what the first compiled (a small function: the real kernels take seconds)."""
    script = tmp_path / "cached.py"
    script.write_text(
        "import numpy as np\nfrom src.actors.lif_kernel import _ROW, void\nfrom src.actors.kernels import compiled\n"
        "def double(row):\n    for j in range(row.shape[0]):\n        row[j] = 2 * row[j]\n"
        "kernel = compiled(double, void(_ROW))\nprint(sum(kernel.stats.cache_hits.values()))\n"
    )
    environment = {"NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONPATH": str(ROOT)}
    run = lambda: subprocess.run([sys.executable, script], env=environment, capture_output=True, text=True, check=True)  # noqa: E731
    assert [run().stdout.strip(), run().stdout.strip()] == ["0", "1"]
