"""What is compiled, and who knows an address, lies in src/engine alone.

If this fails, the paper's modules are on their way back to being the engine.
"""

from __future__ import annotations

import re
from pathlib import Path

import pytest

SRC = Path(__file__).resolve().parents[1] / "src"
WORDS = re.compile(
    r"\b(?:import|from) (?:numba|llvmlite)\b"
    r"|\b(?:njit|carray|data_ptr|untyped_storage|addressof|c_void_p|from_address)\b"
)


def outside_the_engine() -> list[Path]:
    return sorted(path for path in SRC.rglob("*.py") if SRC / "engine" not in path.parents)


@pytest.mark.parametrize("path", outside_the_engine(), ids=lambda path: str(path.relative_to(SRC)))
def test_no_module_outside_the_engine_compiles_or_takes_addresses(path: Path) -> None:
    found = sorted(set(WORDS.findall(path.read_text())))
    assert not found, f"{path.relative_to(SRC.parent)} says {', '.join(found)}: that belongs to src/engine"


@pytest.mark.parametrize("folder", ["actors", "algorithms"])
def test_the_paper_does_not_import_the_engine(folder: str) -> None:
    """But for the one place that chooses the backend."""
    importing = [path for path in sorted((SRC / folder).rglob("*.py")) if "src.engine import" in path.read_text()]
    assert importing in ([], [SRC / "algorithms" / "build.py"])
