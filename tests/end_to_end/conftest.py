"""Undisturbed runs, shared: what every disturbed one must end like."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest

from tests.end_to_end.commands import AAN, Forked, forked, real, wait_for
from tests.gate import close_gate, waiting


@pytest.fixture(scope="session")
def reference(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The results of ``AAN``, by ``python -m src.run`` as a user starts it."""
    results = tmp_path_factory.mktemp("reference")
    process = real(results, *AAN)
    output, _ = process.communicate(timeout=240)
    assert process.returncode == 0, output
    return results


@pytest.fixture(scope="session")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Path]:
    """The results of any other command, run once."""
    known: dict[tuple[str, ...], Path] = {}

    def results_of(*arguments: str) -> Path:
        if arguments not in known:
            known[arguments] = tmp_path_factory.mktemp("undisturbed")
            code, output = forked(known[arguments], *arguments)
            assert code == 0, output
        return known[arguments]

    return results_of


@pytest.fixture(scope="session")
def interrupted(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The results of ``AAN`` stopped by SIGTERM with two checkpoints on the disk; copy it."""
    results, gate = tmp_path_factory.mktemp("interrupted"), tmp_path_factory.mktemp("gate")
    process = Forked(results, *AAN, prepare=partial(close_gate, str(gate), 200))
    assert wait_for(lambda: waiting(gate, 0), process), process.output
    process.signal(15)
    assert process.wait() == 75, process.output
    return results
