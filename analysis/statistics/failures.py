"""Failure rate as an outcome of its own: the share of runs that end below a stated score."""

from __future__ import annotations

from typing import Any

import pandas as pd

from analysis.claims_file import Claims, Kind
from analysis.data.cells import Cell
from analysis.data.names import actor_name, algorithm_name, task_name
from analysis.failure_rates import Rate, difference, failures, rate
from analysis.references import scale
from analysis.tables import Column, Table, number, p_value, text
from analysis.verdicts import ClaimResult, Judgement


def rates_table(cells: list[Cell], claims: Claims) -> Table:
    """One row per algorithm, task and actor with a normalised score."""
    rows: list[dict[str, Any]] = []
    for cell in cells:
        of_task = scale(cells, cell.algo, cell.env, claims)
        if of_task and cell.n:
            failed = failures(of_task.normalised(cell.final), claims.failure_score)
            share = rate(failed, cell.n)
            rows.append(
                {
                    "algo": cell.algo,
                    "env": cell.env,
                    "arm": cell.arm,
                    "algorithm": algorithm_name(cell.algo),
                    "task": task_name(cell.env),
                    "actor": actor_name(cell.arm),
                    "n": cell.n,
                    "failed": failed,
                    "share": share.share,
                    "low": share.low,
                    "high": share.high,
                    "shown": _percent(share),
                }
            )
    columns: list[Column] = [
        ("algorithm", "Algorithm", text),
        ("task", "Task", text),
        ("actor", "Actor", text),
        ("failed", "Failed", number()),
        ("n", "of", number()),
        ("shown", "Share [95%]", str),
    ]
    caption = (
        f"Runs whose final performance is below {claims.failure_score:g} normalised points (0: a random policy, 100: "
        "the AAN reference; failure_score of the claims file). Clopper and Pearson's exact interval."
    )
    frame = pd.DataFrame(rows) if rows else pd.DataFrame(columns=[key for key, _, _ in columns])
    empty = "No finished run on a task with a reference score."
    return Table("failure_rates", "statistics", "Failure rates", caption, frame, columns, empty, folded=True)


def comparisons_table(judgement: Judgement) -> Table:
    """One row per algorithm and claimed difference."""
    rows = [_row(one) for one in judgement.results if one.claim.kind is Kind.DIFFERENCE and one.covered]
    columns: list[Column] = [
        ("algorithm", "Algorithm", text),
        ("text", "Claim", text),
        ("tasks", "Tasks", str),
        ("failed", "Failed", str),
        ("shown", "Difference in percentage points [95%]", str),
        ("p", "p (not adjusted)", p_value),
    ]
    caption = (
        f"How often the two actors of a claim fail (below {judgement.rule.failure_score:g} normalised points): mean "
        "over its tasks of the differences in share; below 0, the claimed better actor fails less. Newcombe's "
        "interval, over tasks; p: Mantel and Haenszel's test over tasks, with continuity correction. A second look at "
        "the same runs: no verdict rests on it."
    )
    frame = pd.DataFrame(rows) if rows else pd.DataFrame(columns=[key for key, _, _ in columns])
    empty = "No claimed difference has finished runs of both actors on a task with a reference score."
    title = "Failure rates of the claimed differences"
    return Table("failure_comparisons", "statistics", title, caption, frame, columns, empty, folded=True)


def _row(one: ClaimResult) -> dict[str, Any]:
    covered = [task for task in one.tasks if task.covered]
    failed = [(task.arms[0].failed, task.arms[1].failed) for task in covered]
    n = [(task.arms[0].n, task.arms[1].n) for task in covered]
    found, p = difference(failed, n)
    sums = [(sum(f[k] for f in failed), sum(m[k] for m in n)) for k in (0, 1)]
    return {
        "algo": one.algo,
        "claim": one.claim.name,
        "difference": found.share,
        "low": found.low,
        "high": found.high,
        "p": p,
        "algorithm": algorithm_name(one.algo),
        "text": one.claim.text,
        "tasks": f"{len(covered)} of {len(one.tasks)}",
        "failed": " against ".join(f"{count} of {runs}" for count, runs in sums),
        "shown": _percent(found),
    }


def _percent(found: Rate) -> str:
    show = number(0)
    return f"{show(100 * found.share)}% [{show(100 * found.low)}, {show(100 * found.high)}]"
