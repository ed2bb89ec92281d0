"""If these fail, training is many times slower than it could be, with the same numbers."""

import subprocess
import sys

import pytest
import torch

from src.training.numerics import set_numerics
from tests.experiment.cells import ROOT

FAULTS = """
import resource, torch
from src.training.numerics import set_numerics

set_numerics(1)
for _ in range(20):
    arrays = [torch.ones(16 << 20, dtype=torch.uint8) for _ in range(4)]
    del arrays
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt)
"""


def test_denormal_numbers_are_flushed() -> None:
    set_numerics(threads=torch.get_num_threads())
    assert float(torch.tensor(1e-39) * torch.tensor(1.0)) == 0.0


@pytest.mark.skipif(sys.platform != "linux", reason="glibc's malloc")
def test_freed_arrays_are_not_faulted_in_anew() -> None:
    """In a process of its own: what lies above an array on the heap decides too. All arrays are 327,680 pages."""
    done = subprocess.run([sys.executable, "-c", FAULTS], cwd=ROOT, capture_output=True, text=True, check=True)
    assert int(done.stdout) < 100_000
