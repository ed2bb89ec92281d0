"""The first screen of the report: the answer in a sentence, the notes that matter, the forest plot."""

from __future__ import annotations

import math
from typing import Any

from analysis.claims_file import Family
from analysis.coverage import covers, few_seeds
from analysis.data.cells import Cell
from analysis.data.names import algorithm_name, ordered_algorithms
from analysis.data.study import Study
from analysis.first_notes import first_notes
from analysis.forest_rows import ForestRow, limits, rows_of
from analysis.overview import overview
from analysis.verdicts import Judgement, Verdict
from analysis.verdicts.wording import headline, rule_words

#: Units of the drawing's width.
WIDTH = 400.0
#: More exploratory rows than this are folded.
MOST_ROWS = 12
VERDICTS = {
    str(Verdict.SUPPORTED): {"mark": "✓ supported", "tone": "good"},
    str(Verdict.CONTRADICTED): {"mark": "✗ contradicted", "tone": "bad"},
    str(Verdict.UNDECIDED): {"mark": "? undecided", "tone": "plain"},
    "no relevant difference": {"mark": "≈ no relevant difference", "tone": "plain"},
    "supported, smaller than relevant": {"mark": "✓ supported, smaller than relevant", "tone": "good"},
    "contradicted, smaller than relevant": {"mark": "✗ contradicted, smaller than relevant", "tone": "bad"},
    str(Verdict.TOO_FEW_SEEDS): {"mark": "too few seeds", "tone": "plain"},
    str(Verdict.NOT_TESTABLE): {"mark": "not testable", "tone": "plain"},
}


def first_screen(study: Study, cells: list[Cell], judgement: Judgement) -> dict[str, Any]:
    """For ``tables.json``; plain values only."""
    about = overview(study)
    algos = ordered_algorithms(study.runs["algo"])
    forests = [forest for algo in algos for forest in _forests(judgement, algo, about["title"], len(algos) > 1)]
    return about | {
        "answer": headline(judgement),
        "first": [note for note in [about["caution"], *first_notes(study, cells, judgement)] if note],
        "forests": forests,
        "verdicts": VERDICTS,
        "bootstrap": few_seeds(),
        "rule": rule_words(judgement),
    }


def _forests(judgement: Judgement, algo: str, title: str, several: bool) -> list[dict[str, Any]]:
    """The declared claims and the user's, then the exploratory ones."""
    rows, name = rows_of(judgement, algo), f"{title}, {algorithm_name(algo)}" if several else title
    automatic = [row for row in rows if row.family == Family.EXPLORATORY]
    stated = [row for row in rows if row.family != Family.EXPLORATORY]
    shown = [_forest(judgement, algo, name, stated, False)] if _measured(stated) or not automatic else []
    if automatic:
        words = f"Exploratory comparisons with the baselines{f', {algorithm_name(algo)}' if several else ''}"
        shown.append(_forest(judgement, algo, words, automatic, bool(_measured(stated)) and len(automatic) > MOST_ROWS))
    return shown


def _forest(judgement: Judgement, algo: str, title: str, rows: list[ForestRow], folded: bool) -> dict[str, Any]:
    band = judgement.rule.smallest_effect
    measured = _measured(rows)
    untested = [row.label for row in rows if row.pooled and math.isnan(row.estimate)]
    low, high = limits(measured, band)

    def at(value: float) -> float:
        return round((min(max(value, low), high) - low) / (high - low) * WIDTH, 1)

    caption = (
        "Difference in final performance in normalised points (0: a random policy, 100: the AAN reference), pooled "
        "over the tasks, 95% intervals unadjusted; right of the dashed line: as claimed. Shaded: "
        f"±{band:g} points, the smallest relevant effect. Wider intervals of tasks are cut at the edge. "
        f"{covers('pooled')}"
    )
    return {
        "algo": algo,
        "title": title,
        "folded": folded,
        "verdicts": any(row.verdict for row in rows),
        "low": f"{low:,.0f}".replace("-", "−"),
        "high": f"{high:,.0f}",
        "zero": at(0.0),
        "band": [at(-band), round(at(band) - at(-band), 1)],
        "rows": [_row(row, at) for row in measured],
        "caption": caption + (f" Without comparable finished runs: {'; '.join(untested)}." if untested else ""),
        "files": [f"forest-{algo}.{kind}" for kind in ("pdf", "png", "csv")] if measured else [],
        "missing": "No claim has finished runs of all its actors on any task.",
    }


def _measured(rows: list[ForestRow]) -> list[ForestRow]:
    return [row for row in rows if not math.isnan(row.estimate)]


def _row(row: ForestRow, at: Any) -> dict[str, Any]:
    known = not math.isnan(row.estimate)
    half = 3.0 if row.pooled else 2.0
    return {
        "pooled": row.pooled,
        "label": row.label,
        "control": row.control,
        "n": row.n.removeprefix("n="),
        "effect": row.effect,
        "verdict": row.verdict,
        "tone": row.tone,
        "remark": row.remark,
        "at": round(at(row.estimate) - half, 1) if known else None,
        "range": [at(row.low), at(row.high)] if known and not math.isnan(row.low) else None,
    }
