"""For every test: the same random numbers every time, examples untimed on a busy machine, no trace of training."""

import os
import signal
import sys
from collections.abc import Iterator

import pytest
from hypothesis import settings

if os.environ.get("TEST_BLAS"):  # the suite under the other library: TEST_BLAS=mkl python -m pytest
    from src.engine import blas

    blas._is_intel = lambda: os.environ["TEST_BLAS"] == "mkl"

settings.register_profile("untimed", deadline=None)
settings.load_profile("untimed")

# A script's background job ignores SIGINT, and so would every process that a test starts and interrupts.
signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(autouse=True)
def _random_numbers() -> None:
    """A test that fails does so again; what is tested draws from streams of its own."""
    if "torch" in sys.modules:  # the analysis does without
        sys.modules["torch"].manual_seed(0)


@pytest.fixture(autouse=True)
def _denormal_numbers() -> Iterator[None]:
    """Training flushes them to zero, for the whole process; hypothesis, for one, needs them."""
    yield
    if "torch" in sys.modules:
        sys.modules["torch"].set_flush_denormal(False)
