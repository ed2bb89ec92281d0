"""Two labels of a study, or two studies, side by side: one row per algorithm, task and label that both have."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from analysis.data.cells import Cell, cells_of
from analysis.data.errors import InputError
from analysis.data.flatten import differing_keys
from analysis.data.names import algorithm_name, task_name
from analysis.data.study import Study, read_study
from analysis.hypothesis_tests import welch_contrast
from analysis.improvement import SEPARATED, improvement_with_interval
from analysis.metrics import hedges_g
from analysis.tables import Column, Table, number, p_value, pair, spread, text


@dataclass(frozen=True)
class Side:
    """``results/<study>`` with all its labels, or one ``label`` of it."""

    name: str
    study: Study
    label: str | None

    def cells(self, algo: str | None) -> list[Cell]:
        """The cells of this side; refuses a label or an algorithm that the study does not have."""
        every = cells_of(self.study)
        here = [cell for cell in every if algo in (None, cell.algo)]
        if not here:
            has = ", ".join(dict.fromkeys(cell.algo for cell in every)) or "no runs"
            raise InputError(f"Study {self.study.name} has no runs{f' under {algo}' if algo else ''}; it has {has}.")
        if self.label and self.label not in {cell.arm for cell in here}:
            has = ", ".join(dict.fromkeys(cell.arm for cell in here))
            raise InputError(f"Study {self.study.name} has no label {self.label!r}; it has {has}.")
        return [cell for cell in here if self.label in (None, cell.arm)]


def side(given: str, study: Path | None) -> Side:
    """``results/paper`` is a study, ``results/paper:bptsan`` a label of it, ``bptsan`` a label of ``--study``."""
    folder, colon, label = given.rpartition(":")
    if Path(given).is_dir():
        return Side(given, read_study(Path(given)), None)
    if colon and Path(folder).is_dir():
        return Side(given, read_study(Path(folder)), label)
    if study is None:
        raise InputError(
            f"{given!r} is no folder; name a study (results/paper), a label of one (results/paper:{given}), or add "
            f"--study."
        )
    return Side(given, read_study(study), given)


def compare(a: Side, b: Side, algo: str | None = None) -> tuple[Table, list[str]]:
    """The table, and sentences about what else differs between the sides.

    Raises:
        InputError: the sides have no task in common, or no label where whole studies are compared.
    """
    left, right = a.cells(algo), b.cells(algo)
    rows, notes = [], [f"{s.name}: {note}" for s in (a, b) for note in s.study.warnings]
    for cell in left:
        for other in right:
            same_label = cell.arm == other.arm or a.label is not None or b.label is not None
            if (cell.algo, cell.env) != (other.algo, other.env) or not same_label:
                continue
            where = f"{algorithm_name(cell.algo)}, {task_name(cell.env)}, {cell.arm} / {other.arm}"
            name, its_name = (f"{c.algo}/{c.env}/{c.arm}" for c in (cell, other))
            differing = differing_keys(
                a.study.configurations[name],
                b.study.configurations[its_name],
                a.study.hashed_keys.get(name),
                b.study.hashed_keys.get(its_name),
            )
            unequal = cell.training_steps != other.training_steps
            remarks = [
                f"unequal training, {cell.training_steps:,} against {other.training_steps:,} steps: not comparable"
            ] * unequal
            if differing:
                shown = [f"{key}: {x} / {y}" for key, x, y in differing[:8]]
                more = [f"and {len(differing) - 8} more keys"] if len(differing) > 8 else []
                remarks.append("differ in " + "; ".join(shown + more))
            notes += [f"{where}: {remark}." for remark in remarks]
            rows.append(_row(cell, other, tested=not unequal) | {"remark": "; ".join(remarks)})
    if not rows:
        raise InputError(
            f"{a.name} and {b.name} have no algorithm, task and label in common, so there is nothing to compare."
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
        f"Nothing is tested after unequal training. {SEPARATED}"
    )
    return Table("compare", "statistics", "Side by side", caption, pd.DataFrame(rows), columns), notes


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
    return {
        "algorithm": algorithm_name(a.algo),
        "task": task_name(a.env),
        "labels": a.arm if a.arm == b.arm else f"{a.arm} / {b.arm}",
        "a": shown[0],
        "b": shown[1],
        "difference": difference,
        "p": contrast.p if tested else np.nan,
        "effect": effect,
        "improvement": improvement,
    }
