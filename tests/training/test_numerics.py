"""If these fail, training is many times slower than it could be, with the same numbers."""

import resource
import sys

import pytest
import torch

from src.training.numerics import set_numerics


def test_denormal_numbers_are_flushed() -> None:
    set_numerics(threads=torch.get_num_threads())
    assert float(torch.tensor(1e-39) * torch.tensor(1.0)) == 0.0


@pytest.mark.skipif(sys.platform != "linux", reason="glibc's malloc")
def test_freed_arrays_are_not_faulted_in_anew() -> None:
    set_numerics(threads=torch.get_num_threads())

    def faults() -> int:
        before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
        for _ in range(20):
            arrays = [torch.ones(2 << 20, dtype=torch.uint8) for _ in range(4)]
            del arrays
        return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before

    faults()
    assert faults() < 200  # 20 x 4 x 512 pages
