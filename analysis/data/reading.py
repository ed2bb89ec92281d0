"""One run directory, read with suspicion: what ``docs/run-directory.md`` promises is checked, nothing is guessed.

A file that is damaged in a way that could move a number makes the run unreadable (it is listed, and counts nowhere);
what a kill can leave behind (a torn last line, a half-written evaluation) is left out with a warning. Files that the
analysis does not know are not looked at.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from analysis.data.errors import UnreadableRunError
from analysis.data.evaluations import read_evaluations
from analysis.data.files import read_text
from analysis.data.operations import Operations, read_operations
from analysis.data.robustness import read_robustness
from analysis.data.schema import Configuration, Manifest, check_configuration, parse_manifest
from analysis.data.training_log import read_training
from analysis.data.yaml_tree import load_tree

MOST_EVALUATIONS = 1_000_000
_MEGABYTES = 4


@dataclass(frozen=True)
class Run:
    """A run as its files tell it.

    Attributes:
        path: ``algo/env/label/encoder/seed_k``, its place below ``runs/``.
        manifest: what happened to it.
        config: the resolved configuration as written.
        settings: what the analysis uses of ``config``, typed.
        evaluations: one row per evaluation, ``step, return, length``; returns may be NaN or infinite.
        training: the rows of ``training.csv``.
        warnings: what was left out of it, as clauses.
        operations: what a decision of its policy costs, where that was counted.
        robustness: its returns under disturbances, where they were played; else empty.
    """

    path: str
    manifest: Manifest
    config: dict[str, Any]
    settings: Configuration
    evaluations: pd.DataFrame
    training: pd.DataFrame
    warnings: tuple[str, ...]
    operations: Operations | None
    robustness: pd.DataFrame


def read_run(folder: Path, path: str) -> Run:
    """Read one run directory; ``path`` is its place below ``runs/`` and the identity it claims.

    Raises:
        UnreadableRunError: one sentence that says what is wrong with it.
    """
    manifest = _manifest(folder, path)
    config, settings = _configuration(folder)
    warnings = _contradictions(manifest, settings)
    protocol = settings.protocol
    if manifest.total_steps > MOST_EVALUATIONS * protocol.evaluation_interval:
        raise UnreadableRunError(
            f"it asks for {manifest.total_steps:,} steps and an evaluation every {protocol.evaluation_interval:,}: "
            f"more than {MOST_EVALUATIONS:,} evaluations"
        )
    evaluations = read_evaluations(
        folder / "evaluations.csv", protocol.evaluation_episodes, manifest.total_steps, warnings
    )
    early = (manifest.step or 0) < protocol.evaluation_interval
    training = read_training(folder / "training.csv", warnings, early)
    operations = read_operations(folder / "operations.json", warnings)
    robustness = read_robustness(folder / "robustness.csv", warnings)
    return Run(path, manifest, config, settings, evaluations, training, tuple(warnings), operations, robustness)


def _manifest(folder: Path, path: str) -> Manifest:
    try:
        manifest = parse_manifest(read_text(folder / "manifest.json", _MEGABYTES))
    except FileNotFoundError:
        raise UnreadableRunError("it has no manifest.json, so it is no run directory") from None
    if manifest.path != path:
        raise UnreadableRunError(f"its manifest.json says that it is {manifest.path}: the folder was moved or copied")
    return manifest


def _configuration(folder: Path) -> tuple[dict[str, Any], Configuration]:
    try:
        config = load_tree(read_text(folder / "config.yaml", _MEGABYTES), "config.yaml")
    except FileNotFoundError:
        raise UnreadableRunError("it has no config.yaml") from None
    return config, check_configuration(config)


def _contradictions(manifest: Manifest, settings: Configuration) -> list[str]:
    """Where ``config.yaml`` looks like that of another run. The returns are this run's, so it counts."""
    pairs = (
        ("algo.name", settings.algo.name, manifest.algo),
        ("env.name", settings.env.name, manifest.env),
        ("actor.name", settings.actor.name, manifest.actor),
        ("encoder.coding", settings.encoder.coding, manifest.encoder),
        ("seed", settings.seed, manifest.seed),
    )
    return [
        f"its config.yaml has {key} = {written}, its manifest.json says {own}; one of the two is of another run"
        for key, written, own in pairs
        if written != own
    ]
