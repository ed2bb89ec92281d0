"""For every test: how long an example takes on a busy machine says nothing, and training leaves no trace."""

import sys
from collections.abc import Iterator

import pytest
from hypothesis import settings

settings.register_profile("untimed", deadline=None)
settings.load_profile("untimed")


@pytest.fixture(autouse=True)
def _denormal_numbers() -> Iterator[None]:
    """Training flushes them to zero, for the whole process; hypothesis, for one, needs them."""
    yield
    if "torch" in sys.modules:  # the analysis does without
        sys.modules["torch"].set_flush_denormal(False)
