"""The tables of verdicts: each claim over all tasks, and each claim x task row."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import pandas as pd

from analysis.bootstrap import FEW_SEEDS
from analysis.claims import Overall, Row
from analysis.claims_file import Claims
from analysis.data.names import actor_name, algorithm_name, task_name
from analysis.improvement import SEPARATED
from analysis.tables import Column, Table, number, p_value, pair, text
from analysis.tests_of_claims import detectable_effect
from analysis.untested import summary


def overall_table(results: list[Overall], rows: list[Row], title: str) -> Table:
    """One row per claim: the verdict "on every "
    "task"; where nothing could be tested, one sentence. The CSV has a row per
    algorithm too.
    """
    frame = pd.DataFrame(
        [
            {
                "algo": " and ".join(algorithm_name(algo) for algo in r.algo.split(" and ")),
                "claim": r.claim.text,
                "source": r.claim.source,
                "verdict": r.verdict,
                "why": r.why,
                "name": r.claim.name,
            }
            for r in results
        ],
        columns=["algo", "claim", "source", "verdict", "why", "name"],
    )
    columns: list[Column] = [
        ("algo", "Algorithm", text),
        ("claim", "Claim, on every task", text),
        *_source(results),
        ("verdict", "Verdict", text),
        ("why", "Why", text),
    ]
    caption = (
        "Supported: every task of the claim supports it. Contradicted: a task contradicts it. Else undecided. "
        "“Undecided” says that these runs do not tell, not that the actors are equal."
    )
    untested = [row for row in rows if row.reason]
    if untested:
        caption += (
            f" What is not testable on a task cannot be supported on every task by this study. {_reasons(untested)}"
        )
    together = [" and " in result.algo for result in results]  # a row for all algorithms, which holds what theirs say
    instead = ""
    if rows and all(row.reason for row in rows):
        claims = len({row.claim.name for row in rows})
        instead = f"None of the {claims} claims can be tested with these runs. {_reasons(rows)}"
    empty = "No runs, so no verdicts."
    shown = frame[together] if any(together) else None
    return Table("verdicts", "verdicts", title, caption, frame, columns, empty, display=shown, instead=instead)


def _source(items: Sequence[Overall | Row]) -> list[Column]:
    """A column that tells a user's claims from the paper's, where there are any."""
    return [("source", "Source", text)] if any(item.claim.source == "user" for item in items) else []


def _reasons(rows: Sequence[Row]) -> str:
    """Why rows could not be tested, by algorithm."""
    algos = dict.fromkeys(row.algo for row in rows)
    return " ".join(f"{algorithm_name(a)}: {summary(row for row in rows if row.algo == a)}." for a in algos)


def rule(rows: list[Row], claims: Claims) -> list[str]:
    """The verdict rule and its power, with this file's alpha and power and this study's number of tests."""
    tests = max([sum(not row.reason for row in rows if row.algo == algo) for algo in {r.algo for r in rows}], default=0)
    few = claims.minimum_seeds
    effects = []
    for n in dict.fromkeys((10, few)):
        single = detectable_effect(n, claims.alpha, claims.power)
        corrected = detectable_effect(n, claims.alpha / tests, claims.power) if tests > 1 else None
        holm = f" ({corrected:.1f} at the first step of Holm's correction over {tests} tests)" if corrected else ""
        effects.append(f"{n} against {n} seeds: {single:.1f} standard deviations{holm}")
    return [
        "Seeds are the unit. Final performance is compared by Welch's test, two-sided; Holm's correction runs over all "
        f"claim × task rows of one algorithm. Supported: adjusted p below {claims.alpha:g} in the claimed direction. "
        f"Contradicted: the same in the other direction. Else undecided, and with fewer than {few} seeds in an arm "
        "undecided without an interval. “On every task” needs every task of the claim. “No difference detected” is not "
        "“equal”. Variants (labels with changed keys) never enter a claim about the paper's actors.",
        f"The true difference that a single test detects with {claims.power:.0%} power at alpha {claims.alpha:g}: "
        f"{'; '.join(effects)}.",
    ]


def claims_table(rows: list[Row], claims: Claims) -> Table:
    """One row per algorithm, claim and task; printed are those that could be tested."""
    frame = pd.DataFrame([_record(row) for row in rows], columns=list(_record_columns()))
    tested = [not row.reason for row in rows]
    columns: list[Column] = [
        ("algorithm", "Algorithm", text),
        ("text", "Claim", text),
        *_source(rows),
        ("task", "Task", text),
        ("verdict", "Verdict", text),
        ("shown", "Difference [95%]", str),
        ("p", "p", partial(p_value, alpha=claims.alpha)),
        ("adjusted_p", "p (Holm)", partial(p_value, alpha=claims.alpha)),
        ("effect", "Hedges' g", number(2)),
        ("improvement_shown", "P(improvement) [95%]", str),
        ("n", "n", str),
        ("seeds", f"Seeds per arm for {claims.power:.0%} power", str),
        ("why", "Remark", text),
    ]
    untested = [row for row in rows if row.reason]
    hidden = (
        f" {len(untested)} rows that cannot be tested stand in the CSV only. {_reasons(untested)}" if untested else ""
    )
    caption = (
        "Welch's test on final performance, two-sided; Holm's correction over all claim x task rows of one algorithm "
        f"that could be tested; alpha {claims.alpha:g}. Intervals and Hedges' g are not adjusted for the number of "
        f"tests. "
        "Synergy is the interaction (both − dendrites alone) − (lateral alone − neither), a contrast of four means "
        "with "
        "Welch–Satterthwaite degrees of freedom; P(improvement) is not defined for it; elsewhere its interval is a "
        "bootstrap's. "
        f"{FEW_SEEDS} {SEPARATED} Seeds per arm at the observed effect: unadjusted / at Holm's first step (alpha "
        f"over the "
        "number of tests). Diverged runs count with their last value; where there are any, the remark gives the "
        "verdict "
        f"without them.{hidden}"
    )
    empty = f"None of these {len(rows)} rows can be tested. {_reasons(rows)}" if rows else "No runs, so no tests."
    title = "Every claim on every task"
    return Table("claims", "statistics", title, caption, frame, columns, empty, display=frame[tested] if rows else None)


def _record_columns() -> tuple[str, ...]:
    return (
        "algo",
        "claim",
        "env",
        "verdict",
        "difference",
        "low",
        "high",
        "p",
        "adjusted_p",
        "df",
        "effect",
        "improvement",
        "improvement_low",
        "improvement_high",
        "n",
        "diverged",
        "seeds_unadjusted",
        "seeds_adjusted",
        "verdict_without_diverged",
        "why",
        "reason",
        "algorithm",
        "text",
        "source",
        "task",
        "shown",
        "improvement_shown",
        "seeds",
    )


def _record(row: Row) -> dict[str, object]:
    contrast, (better, low, high) = row.contrast, row.improvement
    why = row.why
    if any(row.diverged):
        arms = ", ".join(f"{actor_name(a)} {d}" for a, d in zip(row.claim.arms, row.diverged) if d)
        why = "; ".join(filter(None, [why, f"diverged runs: {arms}; without them: {row.without_diverged}"]))
    seeds = "–"
    if row.verdict == "undecided" and contrast.p == contrast.p:
        seeds = f"{_count(row.seeds_unadjusted)} / {_count(row.seeds_adjusted)}"
    return {
        "algo": row.algo,
        "claim": row.claim.name,
        "env": row.env,
        "verdict": row.verdict,
        "difference": contrast.estimate,
        "low": contrast.low,
        "high": contrast.high,
        "p": contrast.p,
        "adjusted_p": row.adjusted_p,
        "df": contrast.df,
        "effect": row.effect,
        "improvement": better,
        "improvement_low": low,
        "improvement_high": high,
        "n": " / ".join(map(str, row.n)),
        "diverged": " / ".join(map(str, row.diverged)),
        "seeds_unadjusted": row.seeds_unadjusted,
        "seeds_adjusted": row.seeds_adjusted,
        "verdict_without_diverged": row.without_diverged,
        "why": why,
        "reason": row.reason,
        "algorithm": algorithm_name(row.algo),
        "text": row.claim.text,
        "source": row.claim.source,
        "task": task_name(row.env),
        "shown": pair(contrast.estimate, contrast.low, contrast.high),
        "improvement_shown": pair(better, low, high, 2),
        "seeds": seeds,
    }


def _count(seeds: int | None) -> str:
    return "over 10,000" if seeds is None else f"{seeds:,}"
