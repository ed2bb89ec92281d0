"""Every claim on every task: the test, the verdict, and what would decide the undecided."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.claims_file import Claim, Claims
from analysis.data.cells import Cell, select
from analysis.data.confounds import confounds
from analysis.data.names import actor_name, algorithm_name, task_name
from analysis.data.study import Study
from analysis.improvement import improvement_with_interval
from analysis.metrics import hedges_g
from analysis.tests_of_claims import Contrast, holm, seeds_for_power, verdict, welch_contrast

Array = NDArray[np.float64]
_NAN = float("nan")


@dataclass
class Row:
    """One claim on one task under one algorithm. ``n`` and ``diverged`` are per arm, in the order of ``claim.arms``."""

    claim: Claim
    algo: str
    env: str
    n: tuple[int, ...]
    diverged: tuple[int, ...]
    contrast: Contrast
    adjusted_p: float
    verdict: str
    why: str
    reason: str  # why it could not be tested, a key of ``untested.REASONS``; empty if it was
    lacking: tuple[str, ...]  # the arms that the reason is about
    effect: float
    improvement: tuple[float, float, float]
    seeds_unadjusted: int | None
    seeds_adjusted: int | None
    without_diverged: str  # the verdict without diverged runs; empty where none diverged


@dataclass
class Overall:
    """A claim over all its tasks under one algorithm, or (``algo`` is "td3 and sac") under all of them."""

    claim: Claim
    algo: str
    verdict: str
    why: str


def decide(study: Study, cells: list[Cell], claims: Claims) -> list[Row]:
    """All rows, Holm-corrected within each algorithm, by METHOD's verdict rule."""
    rows: list[Row] = []
    for algo in dict.fromkeys(cell.algo for cell in cells):
        family = [_row(study, cells, claims, claim, algo, env) for claim in claims.claims for env in claims.tasks]
        again = [_row(study, cells, claims, claim, algo, env, False) for claim in claims.claims for env in claims.tasks]
        _correct(family, claims)
        _correct(again, claims)
        tested = sum(not np.isnan(row.contrast.p) for row, _ in family)
        for (row, arms), (other, _) in zip(family, again):
            if any(row.diverged):
                row.without_diverged = other.verdict
            if row.verdict == "undecided" and not row.why:
                row.why = "no difference detected at this number of seeds, which is not equality"
                row.seeds_unadjusted = seeds_for_power(arms, row.claim.weights, claims.alpha, claims.power)
                row.seeds_adjusted = seeds_for_power(
                    arms, row.claim.weights, claims.alpha / max(tested, 1), claims.power
                )
            rows.append(row)
    return rows


def _correct(family: list[tuple[Row, list[Array]]], claims: Claims) -> None:
    adjusted = holm(np.array([row.contrast.p for row, _ in family]), claims.alpha)
    for (row, _), p in zip(family, adjusted):
        row.adjusted_p, row.verdict = float(p), verdict(float(p), row.contrast.estimate, claims.alpha)


def _row(
    study: Study, cells: list[Cell], claims: Claims, claim: Claim, algo: str, env: str, with_diverged: bool = True
) -> tuple[Row, list[Array]]:
    found = [_arm(cells, claim, algo, env, arm) for arm in claim.arms]
    arms = [(cell.final if with_diverged else cell.without_diverged()) if cell else np.array([]) for cell in found]
    reason, lacking, why = _why_not_tested(study, cells, claims, claim, algo, env, arms)
    contrast = welch_contrast(arms, claim.weights, minimum=claims.minimum_seeds)
    if not reason and np.isnan(contrast.p):
        reason, lacking, why = "variance", claim.arms, "no variance between seeds, so there is no test"
    if reason:
        # what was trained under different settings has no difference that means anything
        contrast = Contrast(_NAN if reason == "settings" else contrast.estimate, _NAN, _NAN, _NAN, _NAN)
    effect, improvement = _NAN, (_NAN, _NAN, _NAN)
    if claim.kind == "difference" and all(len(arm) for arm in arms) and reason != "settings":
        a, b = arms
        effect = hedges_g(a, b)
        improvement = improvement_with_interval([a], [b], claims.minimum_seeds)
    row = Row(
        claim=claim, algo=algo, env=env, n=tuple(len(arm) for arm in arms),
        diverged=tuple(int(cell.diverged.sum()) if cell else 0 for cell in found),
        contrast=contrast, adjusted_p=_NAN, verdict="undecided", why=why, reason=reason, lacking=lacking,
        effect=effect, improvement=improvement,
        seeds_unadjusted=None, seeds_adjusted=None, without_diverged="",
    )  # fmt: skip
    return row, arms


def _arm(cells: list[Cell], claim: Claim, algo: str, env: str, arm: str) -> Cell | None:
    """The arm's cell; for a claim of the paper only if it is the paper's actor, unchanged."""
    found = select(cells, algo, env, arm)
    return found[0] if found and (found[0].paper or claim.source == "user") else None


def _why_not_tested(
    study: Study, cells: list[Cell], claims: Claims, claim: Claim, algo: str, env: str, arms: list[Array]
) -> tuple[str, tuple[str, ...], str]:
    """The reason's key, the arms that it is about, and the remark; all empty where the row can be tested."""
    if not select(cells, algo, env):
        return "task", claim.arms, "no runs on this task"
    if missing := tuple(name for name, values in zip(claim.arms, arms) if not len(values)):
        return "unfinished", missing, f"no finished run of {', '.join(map(actor_name, missing))}"
    if few := {n: len(v) for n, v in zip(claim.arms, arms) if len(v) < claims.minimum_seeds}:
        shown = ", ".join(f"{actor_name(name)} {count}" for name, count in few.items())
        return "few", tuple(few), f"fewer than {claims.minimum_seeds} finished seeds: {shown}"
    if differing := confounds(study, algo, env, claim.arms):
        return "settings", claim.arms, f"the arms were trained under different settings: {'; '.join(differing)}"
    return "", (), ""


def overall(rows: list[Row], claims: Claims) -> list[Overall]:
    """Each claim on all its tasks: supported needs all of them, one contradicted task contradicts, else undecided.

    Where a study has several algorithms, a row for all of them comes before theirs.
    """
    algos = list(dict.fromkeys(row.algo for row in rows))
    results: list[Overall] = []
    for claim in claims.claims if claims.tasks else ():
        each = [
            _on_every_task([row for row in rows if (row.algo, row.claim.name) == (algo, claim.name)]) for algo in algos
        ]
        if len(each) > 1:
            verdict_of_all = _worst([result.verdict for result in each])
            results.append(Overall(claim, " and ".join(algos), verdict_of_all, " ".join(r.why for r in each)))
        results += each
    return results


def _on_every_task(rows: list[Row]) -> Overall:
    first = rows[0]
    by = {kind: [r for r in rows if r.verdict == kind and not r.reason] for kind in ("supported", "contradicted")}
    by["undecided"] = [row for row in rows if row.verdict == "undecided" and not row.reason]
    parts = [f"{kind} on {', '.join(task_name(row.env) for row in found)}" for kind, found in by.items() if found]
    if untested := [row for row in rows if row.reason]:
        parts.append(f"not testable on {', '.join(task_name(row.env) for row in untested)}")
    why = f"{algorithm_name(first.algo)}: {'; '.join(parts)}."
    return Overall(first.claim, first.algo, _worst([row.verdict for row in rows]), why)


def _worst(verdicts: list[str]) -> str:
    return next((kind for kind in ("contradicted", "undecided") if kind in verdicts), "supported")
