"""If these fail, training is many times slower than it could be, with the same numbers."""

import ctypes
import platform
import subprocess
import sys

import pytest
import torch

from src.training.numerics import set_numerics
from tests.experiment.runs import ROOT

FAULTS = """
import resource, sys, torch
from src.training.numerics import set_numerics

if sys.argv[1] == "set":
    set_numerics(1)
before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
for _ in range(20):
    arrays = [torch.ones(16 << 20, dtype=torch.uint8) for _ in range(4)]
    del arrays
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
"""


def test_denormal_numbers_are_flushed() -> None:
    set_numerics(threads=torch.get_num_threads())
    if not torch.set_flush_denormal(True):
        pytest.skip("this processor can't")
    assert float(torch.tensor(1e-39) * torch.tensor(1.0)) == 0.0


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="glibc's malloc")
def test_freed_arrays_are_not_faulted_in_anew() -> None:
    """In processes of their own: what lies above an array on the heap decides too. All arrays are 327,680 pages."""
    otherwise, found = (page_faults(numerics) for numerics in ("as it was", "set"))
    if otherwise < 100_000:
        pytest.skip("this machine's pages are large, or its allocator keeps memory by itself")
    assert found < otherwise / 2


def page_faults(numerics: str) -> int:
    done = subprocess.run(
        [sys.executable, "-c", FAULTS, numerics], cwd=ROOT, capture_output=True, text=True, check=True
    )
    return int(done.stdout)


def test_a_machine_without_mallopt(monkeypatch: pytest.MonkeyPatch) -> None:
    """macOS, musl."""
    monkeypatch.setattr(ctypes, "CDLL", lambda _: object())
    set_numerics(threads=torch.get_num_threads())
