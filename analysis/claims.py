"""Every claim on every task: the test, the verdict, and what would decide the undecided."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.bootstrap import improvement_interval
from analysis.cells import Cell, select
from analysis.claims_file import Claim, Claims
from analysis.flatten import IDENTITY, differing_keys
from analysis.improvement import probability_of_improvement
from analysis.metrics import hedges_g
from analysis.names import actor_name, algorithm_name, task_name
from analysis.study import Study, flat_configuration
from analysis.tests_of_claims import MINIMUM_SEEDS, Contrast, holm, seeds_for_power, verdict, welch_contrast

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
    effect: float
    improvement: tuple[float, float, float]
    seeds_unadjusted: int | None
    seeds_adjusted: int | None
    without_diverged: str  # the verdict without diverged runs; empty where none diverged


@dataclass
class Overall:
    """A claim over all its tasks under one algorithm."""

    claim: Claim
    algo: str
    verdict: str
    why: str


def decide(study: Study, cells: list[Cell], claims: Claims) -> list[Row]:
    """All rows, Holm-corrected within each algorithm, by METHOD's verdict rule."""
    rows: list[Row] = []
    for algo in dict.fromkeys(cell.algo for cell in cells):
        family = [_row(study, cells, claim, algo, env) for claim in claims.claims for env in claims.tasks]
        again = [_row(study, cells, claim, algo, env, False) for claim in claims.claims for env in claims.tasks]
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
    study: Study, cells: list[Cell], claim: Claim, algo: str, env: str, with_diverged: bool = True
) -> tuple[Row, list[Array]]:
    found = [_arm(cells, claim, algo, env, arm) for arm in claim.arms]
    arms = [(cell.final if with_diverged else cell.without_diverged()) if cell else np.array([]) for cell in found]
    why = _why_not_tested(study, claim, algo, env, arms)
    contrast = welch_contrast(arms, claim.weights)
    if not why and np.isnan(contrast.p):
        why = "no variance between seeds, so there is no test"
    if why:
        contrast = Contrast(contrast.estimate, _NAN, _NAN, _NAN, _NAN)
    effect, improvement = _NAN, (_NAN, _NAN, _NAN)
    if claim.kind == "difference" and all(len(arm) for arm in arms):
        a, b = arms
        effect = hedges_g(a, b)
        enough = min(len(a), len(b)) >= MINIMUM_SEEDS
        interval = improvement_interval([a], [b]) if enough and with_diverged else (_NAN, _NAN)
        improvement = (probability_of_improvement([a], [b]), *interval)
    row = Row(
        claim=claim, algo=algo, env=env, n=tuple(len(arm) for arm in arms),
        diverged=tuple(int(cell.diverged.sum()) if cell else 0 for cell in found),
        contrast=contrast, adjusted_p=_NAN, verdict="undecided", why=why, effect=effect, improvement=improvement,
        seeds_unadjusted=None, seeds_adjusted=None, without_diverged="",
    )  # fmt: skip
    return row, arms


def _arm(cells: list[Cell], claim: Claim, algo: str, env: str, arm: str) -> Cell | None:
    """The arm's cell; for a claim of the paper only if it is the paper's actor, unchanged."""
    found = select(cells, algo, env, arm)
    return found[0] if found and (found[0].paper or claim.source == "user") else None


def _why_not_tested(study: Study, claim: Claim, algo: str, env: str, arms: list[Array]) -> str:
    missing = [actor_name(name) for name, values in zip(claim.arms, arms) if not len(values)]
    if missing:
        return f"no finished run of {', '.join(missing)}"
    few = [f"{actor_name(name)} {len(values)}" for name, values in zip(claim.arms, arms) if len(values) < MINIMUM_SEEDS]
    if few:
        return f"fewer than {MINIMUM_SEEDS} finished seeds: {', '.join(few)}"
    differing = unequal_settings(study, algo, env, claim.arms)
    return f"the arms were trained under different settings: {'; '.join(differing)}" if differing else ""


def unequal_settings(study: Study, algo: str, env: str, arms: tuple[str, ...]) -> list[str]:
    """Settings outside the actor in which arms differ ("identical configurations" does not hold), each as a phrase.

    The actor's learning rate and log-std network go with the actor [PopSAN]; a key that a label declares as changed
    is meant.
    """
    exempt = {"algo.actor_learning_rate", "algo.log_std_network", "threads", "device"} | IDENTITY
    runs = study.runs[(study.runs["algo"] == algo) & (study.runs["env"] == env)]
    flat = {arm: flat_configuration(study, algo, env, arm) for arm in arms}
    engines = {arm: runs.loc[runs["arm"] == arm, "engine"].dropna().unique() for arm in arms}
    changed = "".join(runs.loc[runs["arm"].isin(arms), "changed_keys"].unique())
    found: dict[str, str] = {}
    for arm in arms[1:]:
        first = {**flat[arms[0]], "engine": str(list(engines[arms[0]]))}
        for key, old, new in differing_keys(first, {**flat[arm], "engine": str(list(engines[arm]))}, frozenset(exempt)):
            if not key.startswith(("actor.", "encoder.")) and f'{key.removeprefix("algo.")}"' not in changed:
                found.setdefault(key, f"{key} ({old} for {actor_name(arms[0])}, {new} for {actor_name(arm)})")
    return [found[key] for key in sorted(found)]


def overall(rows: list[Row], claims: Claims) -> list[Overall]:
    """Each claim on all its tasks: supported needs all of them, one contradicted task contradicts, else undecided."""
    results = []
    for algo in dict.fromkeys(row.algo for row in rows):
        for claim in claims.claims:
            mine = [row for row in rows if row.algo == algo and row.claim.name == claim.name]
            by = {kind: [r for r in mine if r.verdict == kind] for kind in ("supported", "contradicted", "undecided")}
            untested = [task_name(row.env) for row in mine if np.isnan(row.contrast.p)]
            why = "; ".join(
                f"{kind} on {', '.join(task_name(row.env) for row in found)}" for kind, found in by.items() if found
            )
            if untested:
                why += f". Not testable on {', '.join(untested)}, so this study cannot support it on every task"
            kind = "contradicted" if by["contradicted"] else "undecided" if by["undecided"] else "supported"
            results.append(Overall(claim, algo, kind, f"{algorithm_name(algo)}: {why}."))
    return results
