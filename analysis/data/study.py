"""All run directories of a study as three tidy frames, checked against one another."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pandas as pd

from analysis.data.arms import arm_of, refuse_mixed_arms
from analysis.data.errors import InputError
from analysis.data.flatten import flatten
from analysis.data.reading import Run, UnreadableRunError, read_run
from analysis.data.training_steps import due, missing_at_the_end, training_steps_by_task, unequal_training

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
    "threads",
    "device",
    "versions",
]
EVALUATION_COLUMNS = [*KEYS, "step", "return", "length", "counts_as", "carried"]
LAYOUT = "<algo>/<env>/<label>/<encoder>/seed_<k>"


@dataclass
class Study:
    """A study in memory.

    Attributes:
        runs: one row per readable run, columns ``RUN_COLUMNS``.
        evaluations: one row per run and evaluation (its episodes averaged), columns ``EVALUATION_COLUMNS``; rows that a
            diverged run did not live to see repeat its last value and are marked ``carried``.
        training: ``KEYS`` and the columns of ``training.csv``.
        configurations: the resolved configuration of each cell, keyed ``algo/env/arm``.
        warnings: what a reader has to know, sentences.
    """

    name: str
    runs: pd.DataFrame
    evaluations: pd.DataFrame
    training: pd.DataFrame
    configurations: dict[str, dict[str, Any]] = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)

    @property
    def counted(self) -> pd.DataFrame:
        """The runs whose results count: finished, and diverged with their last value carried forward."""
        return self.runs[self.runs["counts_as"].isin(["finished", "diverged"])]


def read_study(folder: Path) -> Study:
    """Read ``results/<study>``; an empty or missing ``runs/`` gives an empty study with a note.

    Raises:
        InputError: the folder is no study, or a cell mixes configurations.
    """
    if not folder.is_dir():
        raise InputError(f"There is no folder {folder}; give the path of a study, such as results/paper.")
    root, warnings, runs = folder / "runs", [], []
    for path, reason in _candidates(root):
        if reason:
            warnings.append(f"runs/{path}: {reason}; it was left out.")
            continue
        try:
            run = read_run(root / path, path)
        except UnreadableRunError as error:
            warnings.append(f"runs/{path}: {error}; it was left out.")
            continue
        runs.append(run)
        recorded = run.manifest.get("notes")
        warnings.extend(f"runs/{path}: {note}." for note in run.warnings)
        warnings.extend(
            f"runs/{path}, from its manifest: {note}" for note in (recorded if isinstance(recorded, list) else [])
        )
    if not runs:
        warnings.insert(0, f"There are no runs in {folder.name}/runs yet.")
    refuse_mixed_arms(runs)
    return _assemble(folder.name, runs, warnings)


def _candidates(root: Path) -> list[tuple[str, str]]:
    """Folders below ``runs/`` in a fixed order: those that have the layout's depth, and others with what is wrong."""
    if not root.is_dir():
        return []
    depth, found = LAYOUT.count("/") + 1, []
    for path in root.rglob("*"):
        parts = path.relative_to(root).parts
        if not path.is_dir() or any(part.startswith(".") for part in parts) or len(parts) > depth:
            continue
        if len(parts) == depth:
            number = parts[-1].removeprefix("seed_")
            well_named = parts[-1].startswith("seed_") and number.isascii() and number.isdecimal()
            found.append(("/".join(parts), "" if well_named else f"its path is not {LAYOUT}"))
        elif not any(child.is_dir() for child in path.iterdir()):
            found.append(("/".join(parts), f"its path is not {LAYOUT}"))
    return sorted(found, key=_natural)


def _natural(item: tuple[str, str]) -> tuple[str, int, str]:
    cell, _, last = item[0].rpartition("/")
    number = last.removeprefix("seed_")
    return cell, int(number) if number.isascii() and number.isdecimal() else -1, last


def _assemble(name: str, runs: list[Run], warnings: list[str]) -> Study:
    lengths = training_steps_by_task(runs)
    rows: list[dict[str, Any]] = []
    evaluations: list[pd.DataFrame] = []
    training: list[pd.DataFrame] = []
    configurations: dict[str, dict[str, Any]] = {}
    for run in runs:
        m = run.manifest
        training_steps, counts_as = lengths[m["algo"], m["env"]], run.counts_as
        if unequal := unequal_training(run, training_steps):
            warnings.append(unequal)
            counts_as = "unfinished"
        elif incomplete := missing_at_the_end(run, training_steps):
            warnings.append(incomplete)
        arm, paper = arm_of(run)
        keys = {"algo": m["algo"], "env": m["env"], "arm": arm, "seed": m["seed"]}
        parameters = m.get("parameters") or {}
        values = {
            **{column: m.get(column) for column in RUN_COLUMNS},
            **keys,
            "paper": paper,
            "counts_as": counts_as,
            "training_steps": training_steps,
            "evaluations": len(run.evaluations),
            "failure": _failure(m.get("failure")),
            "path": run.path,
            "changed_keys": json.dumps(m.get("changed_keys") or {}, sort_keys=True),
            "versions": json.dumps(m.get("versions") or {}, sort_keys=True),
            "actor_parameters": parameters.get("actor"),
            "critic_parameters": parameters.get("critic"),
        }
        rows.append(values)
        evaluations.append(_with_carried(run, counts_as, training_steps).assign(**keys))
        training.append(run.training.assign(**keys))
        configurations.setdefault("/".join((m["algo"], m["env"], arm)), run.config)
    others = [column for frame in training[:] for column in frame.columns if column not in KEYS]
    return Study(
        name=name,
        runs=pd.DataFrame(rows, columns=RUN_COLUMNS),
        evaluations=_concat(evaluations, EVALUATION_COLUMNS),
        training=_concat(training, [*KEYS, *dict.fromkeys(["step", *others])]),
        configurations=configurations,
        warnings=warnings,
    )


def _failure(failure: Any) -> str | None:
    """What the manifest says of an error, in one line."""
    if not isinstance(failure, dict):
        return None
    return " ".join(f"{failure.get('kind', 'error')}: {failure.get('message', '')}".split()) or None


def _with_carried(run: Run, counts_as: str, training_steps: int) -> pd.DataFrame:
    """The evaluations; for a diverged run also its last one, repeated up to the last step (METHOD: a diverged run
    counts).
    """
    table = run.evaluations[["step", "return", "length"]].assign(counts_as=counts_as, carried=False)
    if counts_as != "diverged":
        return table
    last = table.iloc[-1]
    missing = [step for step in due(run, training_steps) if step > last["step"]]
    carried = pd.DataFrame({"step": missing, "return": last["return"], "length": last["length"]})
    return pd.concat([table, carried.assign(counts_as=counts_as, carried=True)]) if missing else table


def _concat(frames: list[pd.DataFrame], columns: list[str]) -> pd.DataFrame:
    full = [frame for frame in frames if len(frame)]
    if not full:
        return pd.DataFrame(columns=columns)
    return pd.concat(full, ignore_index=True).reindex(columns=columns)


def flat_configuration(study: Study, algo: str, env: str, arm: str) -> dict[str, Any]:
    """The resolved configuration of a cell with dotted keys; empty if the study has no such cell."""
    return flatten(study.configurations.get(f"{algo}/{env}/{arm}", {}))
