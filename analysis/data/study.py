"""All run directories of a study as tidy frames, checked against one another."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pandas as pd

from analysis.data.arms import algorithm_of, arm_of
from analysis.data.cross_checks import cross_checks
from analysis.data.errors import UnreadableRunError
from analysis.data.flatten import flatten
from analysis.data.folders import check_study, run_directories
from analysis.data.mixed import Refused, without_mixed
from analysis.data.names import on_one_line
from analysis.data.operations import COLUMNS as OPERATION_COLUMNS
from analysis.data.outcome import Outcome, RunOutcome, counts, outcomes_of
from analysis.data.reading import Run, read_run
from analysis.data.robustness import COLUMNS as ROBUSTNESS_COLUMNS
from analysis.data.training_steps import due

KEYS = ["algo", "env", "arm", "seed"]
RUN_COLUMNS = [
    *KEYS,
    "label",
    "actor",
    "encoder",
    "paper",
    "counts_as",
    "status",
    "step",
    "total_steps",
    "training_steps",
    "evaluations",
    "failure",
    "path",
    "cell_hash",
    "configuration_hash",
    "engine",
    "changed_keys",
    "observation_size",
    "action_size",
    "actor_parameters",
    "critic_parameters",
    "wall_time_seconds",
    "times_resumed",
    "commit",
    "dirty",
    "processor",
    "blas",
    "backend",
    "threads",
    "device",
    "versions",
]
EVALUATION_COLUMNS = [*KEYS, "step", "return", "length", "counts_as", "carried"]

LONGEST_WARNING = 2_000
BLAS_KEYS = ("library", "version", "architecture")


@dataclass
class Study:
    """A study in memory.

    Attributes:
        runs: one row per readable run, columns ``RUN_COLUMNS``.
        evaluations: one row per run and evaluation (its episodes averaged), columns ``EVALUATION_COLUMNS``; rows that a
            diverged run did not live to see repeat its last value and are marked ``carried``.
        training: ``KEYS`` and the columns of ``training.csv``.
        configurations: the resolved configuration of each cell, keyed ``algo/env/arm``.
        hashed_keys: the keys of it that change numbers, by the same key, where the manifests list them.
        refused: cells that mix configurations; none of their runs stands in the frames.
        warnings: what a reader has to know, sentences.
        operations: one row per run that has an ``operations.json``, ``KEYS`` and the totals of a decision.
        robustness: one row per run and disturbance that was played, ``KEYS, disturbance, severity, return``.
    """

    name: str
    runs: pd.DataFrame
    evaluations: pd.DataFrame
    training: pd.DataFrame
    configurations: dict[str, dict[str, Any]] = field(default_factory=dict)
    hashed_keys: dict[str, list[str]] = field(default_factory=dict)
    refused: list[Refused] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    operations: pd.DataFrame = field(default_factory=lambda: pd.DataFrame(columns=[*KEYS, *OPERATION_COLUMNS]))
    robustness: pd.DataFrame = field(default_factory=lambda: pd.DataFrame(columns=[*KEYS, *ROBUSTNESS_COLUMNS]))

    @property
    def counted(self) -> pd.DataFrame:
        """The runs whose results count: finished, and diverged with their last value carried forward."""
        return self.runs[counts(self.runs)]


def read_study(folder: Path) -> Study:
    """Read every run directory below ``results/<study>/runs``.

    Raises:
        InputError: the folder is no study.
    """
    check_study(folder)
    readable, warnings = _read_all(folder / "runs")
    if not readable:
        warnings.insert(0, f"There are no runs in {folder.name}/runs yet.")
    runs, refused = without_mixed(readable)
    return _assemble(folder.name, outcomes_of(runs), refused, warnings)


def _read_all(root: Path) -> tuple[list[Run], list[str]]:
    runs: list[Run] = []
    warnings: list[str] = []
    for found in run_directories(root):
        if found.remark:
            warnings.append(f"runs/{found.path}: {found.remark}.")
            continue
        wrong = found.wrong
        if not wrong:
            try:
                runs.append(read_run(root / found.path, found.path))
            except UnreadableRunError as error:
                wrong = str(error)
        if wrong:
            warnings.append(f"runs/{found.path}: {wrong}; it was left out.")
    return runs, warnings


def _assemble(name: str, outcomes: list[RunOutcome], refused: list[Refused], warnings: list[str]) -> Study:
    study = Study(
        name=name,
        runs=pd.DataFrame([_row(one) for one in outcomes], columns=RUN_COLUMNS),
        evaluations=_concat([_with_carried(one).assign(**_keys(one.run)) for one in outcomes], EVALUATION_COLUMNS),
        training=_training(outcomes),
        refused=refused,
        operations=_operations(outcomes),
        robustness=_concat(
            [one.run.robustness.assign(**_keys(one.run)) for one in outcomes if len(one.run.robustness)],
            [*KEYS, *ROBUSTNESS_COLUMNS],
        ),
    )
    for cell in refused:
        seeds = ", ".join(map(str, cell.seeds))
        study.warnings.append(f"{cell.algo}/{cell.env}/{cell.arm} was refused (seeds {seeds}): {cell.reason}")
    study.warnings += warnings
    for one in outcomes:
        manifest = one.run.manifest
        key = f"{algorithm_of(one.run)}/{manifest.env}/{arm_of(one.run)[0]}"
        study.configurations.setdefault(key, one.run.config)
        if manifest.hashed_keys:
            study.hashed_keys.setdefault(key, manifest.hashed_keys)
        study.warnings += [f"runs/{one.run.path}: {warning}." for warning in (*one.run.warnings, *one.warnings)]
        study.warnings += [f"runs/{one.run.path}, from its manifest: {note}" for note in manifest.notes]
    study.warnings += cross_checks([one.run for one in outcomes], study.evaluations)
    study.warnings = [_sentence(warning) for warning in study.warnings]
    return study


def _sentence(warning: str) -> str:
    line = on_one_line(warning)
    return line if len(line) <= LONGEST_WARNING else f"{line[:LONGEST_WARNING]}…"


def _keys(run: Run) -> dict[str, Any]:
    manifest = run.manifest
    return {"algo": algorithm_of(run), "env": manifest.env, "arm": arm_of(run)[0], "seed": manifest.seed}


def _row(one: RunOutcome) -> dict[str, Any]:
    """The run's row of ``Study.runs``: what its manifest says, and what was made of it."""
    run = one.run
    manifest = run.manifest
    return {
        **{column: getattr(manifest, column, None) for column in RUN_COLUMNS},
        **_keys(run),
        "paper": arm_of(run)[1],
        "status": manifest.status.value,
        "counts_as": one.outcome.value,
        "training_steps": one.training_steps,
        "evaluations": len(one.evaluations),
        "failure": on_one_line(str(manifest.failure)) if manifest.failure else None,
        "path": run.path,
        "changed_keys": json.dumps(manifest.changed_keys, sort_keys=True),
        "blas": " ".join(value for value in map(manifest.blas.get, BLAS_KEYS) if value) or None,
        "versions": json.dumps(manifest.versions, sort_keys=True),
        "actor_parameters": manifest.parameters.actor,
        "critic_parameters": manifest.parameters.critic,
    }


def _with_carried(one: RunOutcome) -> pd.DataFrame:
    """The evaluations; of a diverged run also its last one, repeated at all later steps (it counts)."""
    table = one.evaluations.assign(counts_as=one.outcome.value, carried=False)
    if one.outcome != Outcome.DIVERGED:
        return table
    last = table.iloc[-1]
    steps = due(one.run.settings.protocol.evaluation_interval, one.training_steps)
    missing = steps[steps > last["step"]]
    carried = pd.DataFrame({"step": missing, "return": last["return"], "length": last["length"]})
    return pd.concat([table, carried.assign(counts_as=one.outcome.value, carried=True)]) if len(missing) else table


def _training(outcomes: list[RunOutcome]) -> pd.DataFrame:
    frames = [one.run.training.assign(**_keys(one.run)) for one in outcomes]
    columns = dict.fromkeys(column for frame in frames for column in frame.columns if column not in KEYS)
    return _concat(frames, [*KEYS, *dict.fromkeys(["step", *columns])])


def _operations(outcomes: list[RunOutcome]) -> pd.DataFrame:
    rows = [_keys(one.run) | one.run.operations.totals() for one in outcomes if one.run.operations]
    return pd.DataFrame(rows, columns=[*KEYS, *OPERATION_COLUMNS])


def _concat(frames: list[pd.DataFrame], columns: list[str]) -> pd.DataFrame:
    full = [frame for frame in frames if len(frame)]
    if not full:
        return pd.DataFrame(columns=columns)
    return pd.concat(full, ignore_index=True).reindex(columns=columns)


def flat_configuration(study: Study, algo: str, env: str, arm: str) -> dict[str, Any]:
    """The resolved configuration of a cell with dotted keys; empty if the study has no such cell."""
    return flatten(study.configurations.get(f"{algo}/{env}/{arm}", {}))
