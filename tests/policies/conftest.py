"""Runs with kept policies, trained once for all tests here."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.helpers import tiny
from tests.training.test_session import run


@pytest.fixture(scope="session")
def tiny_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The directory of a complete run of BPT-SAN on HalfCheetah."""
    return run(tiny(tmp_path_factory.mktemp("trained"), env="halfcheetah"))[1]
