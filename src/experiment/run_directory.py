"""One run's directory: the contract of docs/run-directory.md, as an object."""

from __future__ import annotations

import dataclasses
import logging
from functools import cached_property
from pathlib import Path
from typing import Any

import yaml

from src.config import ExperimentConfig, to_dict
from src.experiment import manifest as manifests
from src.experiment.atomic import replace_file
from src.experiment.csv_log import EvaluationLog, TrainingLog
from src.experiment.labels import label_of
from src.experiment.machine import ROOT
from src.experiment.manifest import Manifest

#: In ``state/``: the replay, and the checkpoints, which must both be there for a complete run to be extended.
REPLAY_FILE = "replay.bin"
CHECKPOINTS = "checkpoint-*.pt"
#: In ``state/``: space that a run gives back when it fails, so that even on a full disk its manifest can say why.
RESERVE_FILE = "reserve"
RESERVE_BYTES = 2**16
#: What a run directory holds besides ``state/``.
FILES = (
    "config.yaml",
    "manifest.json",
    "evaluations.csv",
    "training.csv",
    "failure.txt",
    "policy.pt",
    "policy_best.pt",
)


class RunDirectory:
    """The files of one run. Writing is for the process that has claimed it (:func:`src.experiment.claim.claim`)."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.state = path / "state"
        self._manifest: Manifest | None = None

    @staticmethod
    def path_of(config: ExperimentConfig) -> Path:
        """``results/<study>/runs/<algo>/<env>/<label>/<encoder>/seed_<k>``.

        A relative ``results_dir`` lies in the repository, whatever the working directory.
        """
        study = ROOT / config.results_dir / config.study
        cell = Path(config.algo.name) / config.env.name / label_of(config) / config.encoder.coding
        return study / "runs" / cell / f"seed_{config.seed}"

    @property
    def name(self) -> str:
        """``td3/hopper/bptsan/poisson/seed_2``."""
        return "/".join(self.path.parts[-5:])

    @cached_property
    def evaluations(self) -> EvaluationLog:
        """``evaluations.csv``, a torn last row cut."""
        return EvaluationLog(self.path / "evaluations.csv")

    @cached_property
    def training(self) -> TrainingLog:
        """``training.csv``, a torn last row cut."""
        return TrainingLog(self.path / "training.csv")

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

    def reserve(self) -> None:
        """Set space aside for the last words of a run that dies of a full disk.

        Raises:
            OSError: there is no space even for that.
        """
        (self.state / RESERVE_FILE).write_bytes(bytes(RESERVE_BYTES))

    def give_back_reserve(self) -> None:
        """Free that space."""
        (self.state / RESERVE_FILE).unlink(missing_ok=True)

    def remove_leftovers(self) -> None:
        """Delete what a kill has left of files that were being replaced."""
        for name in FILES:
            for beside in self.path.glob(f".{name}.*"):
                beside.unlink(missing_ok=True)
        for beside in self.state.glob("*.part"):
            beside.unlink(missing_ok=True)

    def cut_after(self, step: int) -> None:
        """Drop what was logged after ``step``: a resumed run goes on from its checkpoint, not from its last row."""
        self.evaluations.cut_after(step)
        self.training.cut_after(step)

    def read_manifest(self) -> Manifest | None:
        """The manifest as it is on disk; None where there is none.

        Raises:
            ManifestError: it can't be read.
        """
        return manifests.read(self.path / "manifest.json")

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
        manifest = dataclasses.replace(manifest, updated=manifests.now())
        manifests.write(self.path / "manifest.json", manifest)
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

    def write_config(self, config: ExperimentConfig) -> None:
        """The resolved configuration, without what belongs to one command or machine (``results_dir``)."""
        content = to_dict(config) | {"label": label_of(config), "results_dir": "results", "on_conflict": "refuse"}
        replace_file(self.path / "config.yaml", yaml.safe_dump(content, sort_keys=False).encode())
