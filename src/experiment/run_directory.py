"""One run's directory, as docs/run-directory.md promises it, and its manifest: what happened to the run."""

from __future__ import annotations

import dataclasses
import json
import logging
from dataclasses import field
from datetime import UTC, datetime
from enum import StrEnum
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

import yaml
from pydantic import ConfigDict, TypeAdapter, ValidationError
from pydantic.dataclasses import dataclass

from src.config.identity import Run
from src.config.validation import to_dict
from src.experiment.files import CsvLog, EvaluationLog, replace_file

#: In ``state/``: the replay, and the checkpoints, which must both be there for a complete run to be extended.
REPLAY_FILE = "replay.bin"
CHECKPOINTS = "checkpoint-*.pt"
#: In ``state/``: space that a run gives back when it fails, so that even on a full disk its manifest can say why.
RESERVE_FILE = "reserve"
RESERVE_BYTES = 2**16
#: The final policy, and that of the best evaluation.
POLICY_FILE = "policy.pt"
BEST_POLICY_FILE = "policy_best.pt"
#: Returns of its policy under disturbances.
ROBUSTNESS_FILE = "robustness.csv"
#: What a run directory holds besides ``state/``.
FILES = (
    "config.yaml",
    "manifest.json",
    "evaluations.csv",
    "training.csv",
    "failure.txt",
    POLICY_FILE,
    BEST_POLICY_FILE,
    "operations.json",
    ROBUSTNESS_FILE,
)
#: What ``python -m src.watch`` has drawn of the policy.
WATCH_FOLDER = "watch"
FORMAT = 1
_STAMP = "%Y-%m-%dT%H:%M:%SZ"


class RunState(StrEnum):
    """The state of a run, in the one vocabulary of manifest, plan, status and the summary of a sweep."""

    COMPLETE = "complete"
    RUNNING = "running"
    INTERRUPTED = "interrupted"  # stopped before its end; the same command again resumes it
    FAILED = "failed"
    DIVERGED = "diverged"  # ended with non-finite numbers: a result
    # never in a manifest:
    NOT_STARTED = "not started"
    NOT_FINISHED = "not finished"  # its process is gone and has recorded nothing
    BUSY = "busy"  # left to another process, which holds it


Status = Literal[RunState.RUNNING, RunState.COMPLETE, RunState.INTERRUPTED, RunState.FAILED, RunState.DIVERGED]


class ManifestError(ValueError):
    """A manifest that can't be read. Its message says what to do."""


@dataclass(frozen=True)
class Failure:
    """Why a run failed or diverged, and at which step."""

    kind: str
    message: str
    step: int


@dataclass(frozen=True, config=ConfigDict(extra="ignore", strict=True))
class Manifest:
    """``manifest.json``; docs/run-directory.md explains every key."""

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
    status: Status = RunState.RUNNING
    step: int = 0
    checkpoint_step: int | None = None
    changed_keys: dict[str, Any] = field(default_factory=dict)
    hashed_keys: list[str] = field(default_factory=list)
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


_SCHEMA = TypeAdapter(Manifest)


def now() -> str:
    """UTC, ISO 8601, to the second."""
    return datetime.now(UTC).strftime(_STAMP)


def seconds_since(stamp: str | None) -> float:
    """Age of a stamp of :func:`now`; infinite for None."""
    if stamp is None:
        return float("inf")
    return (datetime.now(UTC) - datetime.strptime(stamp, _STAMP).replace(tzinfo=UTC)).total_seconds()


class RunDirectory:
    """The files of one run. Writing is for the process that owns it (:func:`src.experiment.ownership.acquire`)."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.state = path / "state"
        self._manifest: Manifest | None = None

    @cached_property
    def evaluations(self) -> EvaluationLog:
        """``evaluations.csv``, a torn last row cut."""
        return EvaluationLog(self.path / "evaluations.csv")

    @cached_property
    def training(self) -> CsvLog:
        """``training.csv``, a torn last row cut."""
        return CsvLog(self.path / "training.csv")

    @cached_property
    def log(self) -> logging.Logger:
        """Writes to ``state/log.txt``."""
        logger = logging.getLogger(f"run.{self.path}")
        logger.setLevel(logging.INFO)
        logger.propagate = False
        if not logger.handlers:
            self.state.mkdir(parents=True, exist_ok=True)
            handler = logging.FileHandler(self.state / "log.txt")
            handler.setFormatter(logging.Formatter("%(asctime)s %(levelname)s %(message)s"))
            logger.addHandler(handler)
        return logger

    @property
    def can_be_extended(self) -> bool:
        """Whether ``state/`` still holds what a longer run goes on from."""
        return (self.state / REPLAY_FILE).exists() and any(self.state.glob(CHECKPOINTS))

    def shrink_state(self) -> None:
        """Of a complete run: leave the logs in ``state/``; it can't be extended then."""
        for file in [self.state / REPLAY_FILE, *self.state.glob(CHECKPOINTS)]:
            file.unlink(missing_ok=True)

    def reserve(self) -> None:
        """Set space aside for the failure record of a run that dies of a full disk.

        Raises:
            OSError: there is no space even for that.
        """
        (self.state / RESERVE_FILE).write_bytes(bytes(RESERVE_BYTES))

    def give_back_reserve(self) -> None:
        """Free that space."""
        (self.state / RESERVE_FILE).unlink(missing_ok=True)

    def remove_leftovers(self) -> None:
        """Delete what a kill has left of files that were being replaced."""
        halves = [half for name in FILES for half in self.path.glob(f".{name}.*")]
        for half in [*halves, *self.state.glob(f".{CHECKPOINTS}.*")]:
            half.unlink(missing_ok=True)

    def cut_after(self, step: int) -> None:
        """Drop what was logged after ``step``: a resumed run goes on from its checkpoint, not from its last row."""
        self.evaluations.cut_after(step)
        self.training.cut_after(step)

    def read_manifest(self) -> Manifest | None:
        """The manifest as it is on disk; None where there is none.

        Raises:
            ManifestError: not one of ours; it is always replaced as a whole, so somebody else has changed it.
        """
        path = self.path / "manifest.json"
        try:
            manifest = _SCHEMA.validate_json(path.read_bytes())
        except (FileNotFoundError, NotADirectoryError):
            return None
        except ValidationError as error:
            first = error.errors()[0]
            key = ".".join(str(part) for part in first["loc"]) or "the file"
            raise ManifestError(
                f"{path}: can't be read ({key}: {first['msg']}); restore it, or delete its run directory."
            ) from None
        if manifest.format != FORMAT:
            raise ManifestError(f"{path}: format {manifest.format}, this code reads format {FORMAT}.")
        return manifest

    @property
    def manifest(self) -> Manifest:
        """The manifest as this process last wrote or read it."""
        if self._manifest is None:
            self._manifest = self.read_manifest()
        if self._manifest is None:
            raise FileNotFoundError(f"{self.path / 'manifest.json'}: this run has not started")
        return self._manifest

    def write_manifest(self, manifest: Manifest) -> None:
        """Replace the manifest atomically and stamp ``updated``."""
        manifest = dataclasses.replace(manifest, updated=now())
        content = {"format": manifest.format} | _SCHEMA.dump_python(manifest, mode="json")
        replace_file(self.path / "manifest.json", (json.dumps(content, indent=1, allow_nan=False) + "\n").encode())
        self._manifest = manifest

    def update_manifest(self, **changes: Any) -> None:
        """Change some keys; the file is replaced atomically and ``updated`` stamped."""
        self.write_manifest(dataclasses.replace(self.manifest, **changes))

    def read_config(self) -> dict[str, Any] | None:
        """``config.yaml`` as plain containers; None where there is none or it can't be read."""
        try:
            content = yaml.safe_load((self.path / "config.yaml").read_text())
        except (OSError, yaml.YAMLError):
            return None
        return content if isinstance(content, dict) else None

    def write_config(self, run: Run) -> None:
        """The resolved configuration, without what belongs to one command or machine (``results_dir``)."""
        content = to_dict(run.config) | {"label": run.label, "results_dir": "results", "on_conflict": "refuse"}
        replace_file(self.path / "config.yaml", yaml.safe_dump(content, sort_keys=False).encode())
