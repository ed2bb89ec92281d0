"""If these fail, products are wrong, or a run uses another library than its manifest says."""

import pytest
import torch

from src.actors.mlp import EnsembleMLP
from src.engine import blas
from src.engine.flat import FlatParameters
from src.engine.mlp import BoundMLP
from src.streams import Streams

HAS_MKL = blas.address("mkl") is not None


def bind(sizes):
    network = EnsembleMLP(sizes, 2, Streams(0), "test")
    FlatParameters(network.parameters())
    return network, BoundMLP(network)


@pytest.fixture(autouse=True)
def leave_the_choice_as_it_was():
    before = dict(blas._selected)
    yield
    blas._selected.clear()
    blas._selected.update(before)


@pytest.mark.parametrize(
    "name", ["openblas", pytest.param("mkl", marks=pytest.mark.skipif(not HAS_MKL, reason="no MKL"))]
)
def test_both_libraries_multiply(name):
    assert blas.select(name).name in (name, "accelerate")
    network, bound = bind([5, 16, 3])
    x = torch.randn(7, 5)
    torch.testing.assert_close(bound.forward(x), network(x).detach())


@pytest.mark.parametrize(
    "intel,has_mkl,expected", [(True, True, "mkl"), (True, False, "openblas"), (False, True, "openblas")]
)
def test_the_rule_goes_by_the_processor(monkeypatch, intel, has_mkl, expected):
    """MKL takes its slower path on other processors than Intel's: half of the machine would be left unused."""
    found = {"openblas": 1, "mkl": 2 if has_mkl else None}
    monkeypatch.setattr(blas, "_is_intel", lambda: intel)
    monkeypatch.setattr(blas, "address", found.get)
    assert blas.select("auto").name in (expected, "openblas")
    assert blas.sgemm_address() == found[expected]


def test_a_resume_keeps_the_library_that_the_run_began_with(monkeypatch):
    monkeypatch.setattr(blas, "_is_intel", lambda: False)
    monkeypatch.setattr(blas, "address", {"openblas": 1, "mkl": 2}.get)
    blas.select("auto", recorded="mkl")
    assert blas.sgemm_address() == 2
    blas.select("openblas", recorded="mkl")  # what the command line asks for wins
    assert blas.sgemm_address() == 1


def test_a_resume_where_its_library_is_gone_takes_the_other(monkeypatch):
    monkeypatch.setattr(blas, "address", {"openblas": 1, "mkl": None}.get)
    blas.select("auto", recorded="mkl")
    assert blas.sgemm_address() == 1
    with pytest.raises(blas.BLASUnavailableError, match="blas=mkl: PyTorch has no MKL here"):
        blas.select("mkl")


def test_the_library_on_record_is_scipys_and_not_numpys(monkeypatch):
    """Both bring an OpenBLAS, whose file is called libscipy_openblas in either; the versions differ."""
    import threadpoolctl

    def found(folder, version, name="libscipy_openblas.so"):
        path = f"/x/site-packages/{folder}/{name}"
        return {"user_api": "blas", "internal_api": "openblas", "filepath": path, "version": version}

    libraries = [found("numpy.libs", "2"), found("scipy.libs", "1")]
    monkeypatch.setattr(threadpoolctl, "threadpool_info", lambda: libraries)
    assert blas._describe.__wrapped__("openblas") == blas.Library("openblas", "1", None)
    libraries[1] = found("scipy/.dylibs", "3")  # on a Mac
    assert blas._describe.__wrapped__("openblas").version == "3"
    del libraries[1]
    assert blas._describe.__wrapped__("openblas") == blas.Library("unknown", None, None)


def test_a_held_back_openblas_is_told(monkeypatch):
    blas.select("openblas")
    monkeypatch.setenv("OPENBLAS_CORETYPE", "Haswell")
    assert "OPENBLAS_CORETYPE=Haswell" in blas.held_back()
    monkeypatch.delenv("OPENBLAS_CORETYPE")
    assert blas.held_back() is None


@pytest.mark.parametrize("offset", range(16))
def test_a_products_bits_hang_on_no_allocator(offset):
    """Whatever address an input has, the numbers are the same: a resumed run lies elsewhere in memory."""
    _, bound = bind([7, 33, 3])
    x = torch.randn(9, 7)
    expected = bound.forward(x)
    moved = torch.empty(9 * 7 + offset)[offset:].view(9, 7).copy_(x)
    assert torch.equal(bound.forward(moved), expected)
