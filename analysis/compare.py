"""Any two sides, side by side: two labels, two algorithms, two studies, or a label here and another there."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from analysis.coverage import coverage
from analysis.data.cells import Cell, cells_of
from analysis.data.errors import InputError
from analysis.data.flatten import differing_keys
from analysis.data.names import algorithm_name, task_name
from analysis.data.study import Study, read_study
from analysis.hypothesis_tests import welch_contrast
from analysis.improvement import SEPARATED, improvement_with_interval
from analysis.metrics import hedges_g
from analysis.tables import Column, Table, number, p_value, pair, spread, text

MOST_KEYS = 8


@dataclass(frozen=True)
class Side:
    """``results/<study>`` with all its algorithms and labels, or one ``algo``, one ``label``, or both."""

    name: str
    study: Study
    algo: str | None = None
    label: str | None = None

    def cells(self, algo: str | None) -> list[Cell]:
        """The cells of this side; refuses a label or an algorithm that the study does not have."""
        every, wanted = cells_of(self.study), self.algo or algo
        for cell in self.study.refused:
            if self.label == cell.arm and wanted in (None, cell.algo):
                raise InputError(f"{cell.algo}/{cell.env}/{cell.arm} of {self.study.name} is refused: {cell.reason}")
        here = [cell for cell in every if wanted in (None, cell.algo)]
        if not here:
            has = ", ".join(dict.fromkeys(cell.algo for cell in every)) or "no runs"
            raise InputError(
                f"Study {self.study.name} has no runs{f' under {wanted}' if wanted else ''}; it has {has}."
            )
        if self.label and self.label not in {cell.arm for cell in here}:
            has = ", ".join(dict.fromkeys(cell.arm for cell in here))
            raise InputError(f"Study {self.study.name} has no label {self.label!r}; it has {has}.")
        return [cell for cell in here if self.label in (None, cell.arm)]


def side(given: str, study: Path | None) -> Side:
    """``results/paper`` is a study; ``results/paper:bptsan``, ``:td3``, ``:td3/bptsan`` a label, an algorithm, a label
    under an algorithm; ``bptsan``, ``td3``, ``td3/bptsan`` the same of ``--study``.
    """
    folder, colon, part = given.rpartition(":")
    if Path(given).is_dir():
        return Side(given, read_study(Path(given)))
    if colon and Path(folder).is_dir():
        return _part(given, read_study(Path(folder)), part)
    if study is None:
        raise InputError(
            f"{given!r} is no folder; name a study (results/paper), a label or an algorithm of one "
            f"(results/paper:{given}), or add --study."
        )
    return _part(given, read_study(study), given)


def _part(name: str, study: Study, part: str) -> Side:
    algos, labels = set(study.runs["algo"]), set(study.runs["arm"])
    if part in algos and part not in labels:
        return Side(name, study, algo=part)
    algo, slash, label = part.partition("/")
    return Side(name, study, algo=algo, label=label) if slash and algo in algos else Side(name, study, label=part)


def compare(a: Side, b: Side, algo: str | None = None) -> tuple[Table, list[str]]:
    """The table, and sentences about what else differs between the sides.

    Raises:
        InputError: the sides have no task in common, or no label or algorithm where several could be paired.
    """
    pairs = _pairs(a, b, algo)
    if not pairs:
        raise InputError(
            f"{a.name} and {b.name} have no algorithm, task and label in common, so there is nothing to compare."
        )
    rows, found = [], []
    for cell, other in pairs:
        unequal = cell.training_steps != other.training_steps
        steps = f"{cell.training_steps:,} against {other.training_steps:,} steps"
        remark = f"unequal training, {steps}: not comparable" if unequal else ""
        rows.append(_row(cell, other, tested=not unequal) | {"remark": remark})
        name, its_name = (f"{c.algo}/{c.env}/{c.arm}" for c in (cell, other))
        found.append(
            differing_keys(
                a.study.configurations[name],
                b.study.configurations[its_name],
                a.study.hashed_keys.get(name),
                b.study.hashed_keys.get(its_name),
            )
        )
    columns: list[Column] = [
        ("algorithm", "Algorithm", text),
        ("task", "Task", text),
        ("labels", "A / B", text),
        ("a", "A: mean ± std", str),
        ("b", "B: mean ± std", str),
        ("difference", "A − B [95%]", str),
        ("p", "p (not adjusted)", p_value),
        ("effect", "Hedges' g", number(2)),
        ("improvement", "P(A > B) [95%]", str),
        ("remark", "Remark", text),
    ]
    caption = (
        f"A is {a.name}, B is {b.name}. Final performance; Welch's test; p is not adjusted for the number of rows. "
        f"The interval of a difference covers the truth {coverage('difference')}. "
        f"Nothing is tested after unequal training. {SEPARATED}"
    )
    notes = [note for note in (_differences(found), _unequal(rows), _own_notes(a, b)) if note]
    return Table("compare", "statistics", "Side by side", caption, pd.DataFrame(rows), columns), notes


def _pairs(a: Side, b: Side, algo: str | None) -> list[tuple[Cell, Cell]]:
    """Cells of one task; of one algorithm and label too, but where both sides leave no choice of it."""
    left, right = a.cells(algo), b.cells(algo)

    def fixed(name: str) -> bool:
        return all(len({getattr(cell, name) for cell in cells}) == 1 for cells in (left, right))

    any_algo = fixed("algo") and None not in (a.algo, b.algo)
    any_label = a.label is not None or b.label is not None or fixed("arm")
    return [
        (cell, other)
        for cell in left
        for other in right
        if cell.env == other.env and (any_algo or cell.algo == other.algo) and (any_label or cell.arm == other.arm)
    ]


def _differences(found: list[list[tuple[str, Any, Any]]]) -> str:
    """One sentence for all rows: the keys of the configurations that differ, those that differ everywhere first."""
    counts: dict[str, int] = {}
    values: dict[str, list[str]] = {}
    for keys in found:
        for key, x, y in keys:
            counts[key] = counts.get(key, 0) + 1
            if (shown := f"{x} / {y}") not in values.setdefault(key, []):
                values[key].append(shown)
    if not counts:
        return ""
    ordered = sorted(counts, key=lambda key: (-counts[key], not key.endswith(".kind"), key))  # kinds first
    parts = [
        f"{key} ({', '.join(values[key][:2])}{', …' if len(values[key]) > 2 else ''}"
        f"{'' if counts[key] == len(found) else f'; in {counts[key]} of {len(found)} rows'})"
        for key in ordered[:MOST_KEYS]
    ]
    more = f"; and {len(ordered) - MOST_KEYS} more keys" if len(ordered) > MOST_KEYS else ""
    return f"The configurations differ, A / B, in {'; '.join(parts)}{more}."


def _unequal(rows: list[dict[str, Any]]) -> str:
    count = sum(bool(row["remark"]) for row in rows)
    return f"{count} of {len(rows)} rows compare unequal training and are not tested." if count else ""


def _own_notes(a: Side, b: Side) -> str:
    counts = {s.study.name: len(s.study.warnings) for s in (a, b) if s.study.warnings}
    shown = ", ".join(f"{name} {count}" for name, count in counts.items())
    return f"Notes about single runs stand in the reports of the studies: {shown}." if counts else ""


def _row(a: Cell, b: Cell, tested: bool) -> dict[str, object]:
    contrast, improvement, effect = welch_contrast([a.final, b.final], (1.0, -1.0)), "–", np.nan
    if a.n and b.n and tested:
        improvement = pair(*improvement_with_interval([a.final], [b.final]), 2)
        effect = hedges_g(a.final, b.final)
    difference = pair(contrast.estimate, contrast.low, contrast.high) if tested else "–"
    shown = [
        spread(cell.final.mean() if cell.n else np.nan, cell.final.std(ddof=1) if cell.n > 1 else np.nan, cell.n)
        for cell in (a, b)
    ]
    algorithms = dict.fromkeys(algorithm_name(cell.algo) for cell in (a, b))
    return {
        "algorithm": " / ".join(algorithms),
        "task": task_name(a.env),
        "labels": a.arm if a.arm == b.arm else f"{a.arm} / {b.arm}",
        "a": shown[0],
        "b": shown[1],
        "difference": difference,
        "p": contrast.p if tested else np.nan,
        "effect": effect,
        "improvement": improvement,
    }
