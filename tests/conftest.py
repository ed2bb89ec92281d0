"""For every test: how long an example takes says nothing about the code on a busy machine, and training leaves no trace."""

from collections.abc import Iterator

import pytest
import torch
from hypothesis import settings

settings.register_profile("untimed", deadline=None)
settings.load_profile("untimed")


@pytest.fixture(autouse=True)
def _denormal_numbers() -> Iterator[None]:
    """Training flushes them to zero, for the whole process; hypothesis, for one, needs them."""
    yield
    torch.set_flush_denormal(False)
