"""Where the repository lies, and what a path means that a user types or reads."""

from __future__ import annotations

from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def repository_path(path: str | Path) -> Path:
    """A path as a user means it, in every command: ``~`` is the home, a relative one lies in the repository."""
    return ROOT / Path(path).expanduser()


def shown_path(path: Path) -> str:
    """Relative where it lies in the repository."""
    return str(path.relative_to(ROOT)) if path.is_relative_to(ROOT) else str(path)
