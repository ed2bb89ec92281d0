"""``manifest.json``: what happened to a run. See docs/run-directory.md for every key."""

from __future__ import annotations

import dataclasses
import json
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Literal

from src.experiment.atomic import replace_file

FORMAT = 1
Status = Literal["running", "complete", "interrupted", "failed", "diverged"]


class ManifestError(ValueError):
    """A manifest that can't be read. Its message says what to do."""


@dataclass(frozen=True)
class Failure:
    """Why a run failed or diverged, and at which step."""

    kind: str
    message: str
    step: int


@dataclass(frozen=True)
class Manifest:
    """One run, typed; the file holds exactly these keys."""

    algo: str
    env: str
    actor: str
    label: str
    encoder: str
    seed: int
    study: str
    configuration_hash: str
    cell_hash: str
    engine: int
    total_steps: int
    threads: int
    device: str
    status: Status = "running"
    step: int = 0
    checkpoint_step: int | None = None
    changed_keys: dict[str, Any] = field(default_factory=dict)
    observation_size: int | None = None
    action_size: int | None = None
    parameters: dict[str, int] = field(default_factory=dict)
    started: str | None = None
    updated: str | None = None
    finished: str | None = None
    wall_time_seconds: float = 0.0
    times_resumed: int = 0
    versions: dict[str, str | None] = field(default_factory=dict)
    commit: str | None = None
    dirty: bool | None = None
    processor: str = "unknown"
    blas: dict[str, str | None] = field(default_factory=dict)
    backend: str | None = None  # that computed the updates: fast or plain
    failure: Failure | None = None
    notes: list[str] = field(default_factory=list)
    format: int = FORMAT


_KEYS = {f.name for f in dataclasses.fields(Manifest)}


def now() -> str:
    """UTC, ISO 8601, to the second."""
    return datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")


def seconds_since(stamp: str | None) -> float:
    """Age of a stamp of :func:`now`; infinite for None."""
    if stamp is None:
        return float("inf")
    return (datetime.now(UTC) - datetime.strptime(stamp, "%Y-%m-%dT%H:%M:%SZ").replace(tzinfo=UTC)).total_seconds()


def write(path: Path, manifest: Manifest) -> None:
    """Replace the file atomically."""
    content = {"format": manifest.format} | dataclasses.asdict(manifest)
    replace_file(path, (json.dumps(content, indent=1, allow_nan=False) + "\n").encode())


def read(path: Path) -> Manifest | None:
    """The manifest at ``path``; None where there is none.

    Raises:
        ManifestError: not one of ours; it is always replaced as a whole, so somebody else has changed it.
    """
    try:
        content = json.loads(path.read_text())
        if content["format"] != FORMAT:
            raise ManifestError(f"{path}: format {content['format']}, this code reads format {FORMAT}.")
        failure = content.get("failure")
        content["failure"] = Failure(**failure) if failure else None
        return Manifest(**{key: value for key, value in content.items() if key in _KEYS})
    except (FileNotFoundError, NotADirectoryError):
        return None
    except ManifestError:
        raise
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise ManifestError(f"{path}: can't be read ({error}); restore it, or delete its run directory.") from None
