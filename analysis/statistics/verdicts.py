"""The tables of verdicts: each claim over all tasks, and each claim x task row."""

from __future__ import annotations

import pandas as pd

from analysis.claims import Overall, Row
from analysis.claims_file import Claims
from analysis.names import actor_name, algorithm_name, task_name
from analysis.tables import Column, Table, number, p_value, pair, text


def overall_table(results: list[Overall]) -> Table:
    """One row per algorithm and claim: the verdict "on every task"."""
    frame = pd.DataFrame(
        [
            {
                "algo": algorithm_name(r.algo),
                "claim": r.claim.text,
                "verdict": r.verdict,
                "why": r.why,
                "name": r.claim.name,
            }
            for r in results
        ],
        columns=["algo", "claim", "verdict", "why", "name"],
    )
    columns: list[Column] = [
        ("algo", "Algorithm", text),
        ("claim", "Claim, on every task", text),
        ("verdict", "Verdict", text),
        ("why", "Why", text),
    ]
    caption = (
        "Supported: every task of the claim supports it. Contradicted: a task contradicts it. Else undecided. "
        "“Undecided” says that these runs do not tell, not that the actors are equal."
    )
    return Table(
        "verdicts", "verdicts", "Verdicts on the paper's claims", caption, frame, columns, "No runs, so no verdicts."
    )


def claims_table(rows: list[Row], claims: Claims) -> Table:
    """One row per algorithm, claim and task."""
    frame = pd.DataFrame([_record(row) for row in rows], columns=list(_record_columns()))
    columns: list[Column] = [
        ("algorithm", "Algorithm", text),
        ("text", "Claim", text),
        ("task", "Task", text),
        ("verdict", "Verdict", text),
        ("shown", "Difference [95%]", str),
        ("p", "p", p_value),
        ("adjusted_p", "p (Holm)", p_value),
        ("effect", "Hedges' g", number(2)),
        ("improvement_shown", "P(improvement) [95%]", str),
        ("n", "n", str),
        ("seeds", "Seeds per arm for 80% power", str),
        ("why", "Remark", text),
    ]
    caption = (
        f"Welch's test on final performance, two-sided; Holm's correction over all claim x task rows of one "
        f"algorithm that could be "
        f"tested; alpha {claims.alpha}. Intervals and Hedges' g are not adjusted for the number of tests. Synergy is "
        f"the interaction "
        "(both − dendrites alone) − (lateral alone − neither), a contrast of four means with Welch–Satterthwaite "
        "degrees of "
        "freedom; P(improvement) is not defined for it. Seeds per arm at the observed effect: unadjusted / at Holm's "
        "first step "
        "(alpha over the number of tests). Diverged runs count with their last value; where there are any, the "
        "remark gives the "
        "verdict without them."
    )
    return Table("claims", "statistics", "Every claim on every task", caption, frame, columns, "No runs, so no tests.")


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
        "algorithm",
        "text",
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
        "algorithm": algorithm_name(row.algo),
        "text": row.claim.text,
        "task": task_name(row.env),
        "shown": pair(contrast.estimate, contrast.low, contrast.high),
        "improvement_shown": pair(better, low, high, 2),
        "seeds": seeds,
    }


def _count(seeds: int | None) -> str:
    return "over 10,000" if seeds is None else f"{seeds:,}"
