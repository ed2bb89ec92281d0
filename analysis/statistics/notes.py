"""What a reader must know in order not to be misled, as sentences."""

from __future__ import annotations

import numpy as np
import pandas as pd

from analysis.claims_file import Claims
from analysis.data.cells import Cell, select
from analysis.data.confounds import confounds
from analysis.data.names import actor_name, algorithm_name, task_name
from analysis.data.outcome import Outcome, counts
from analysis.data.schema import Status
from analysis.data.study import Study
from analysis.references import scale

MOST = 5


def notes(study: Study, cells: list[Cell], claims: Claims) -> list[str]:
    """About runs that did not finish, then about tasks and variants."""
    found = [note for cell in cells for note in _not_finished(study, cell)]
    for algo, env in dict.fromkeys((cell.algo, cell.env) for cell in cells):
        found += _of_task(study, cells, algo, env, claims)
    variants = sorted({actor_name(cell.arm) for cell in cells if not cell.paper})
    if variants:
        found.append(f"Variants, which enter no claim of the paper: {', '.join(variants)}.")
    return found


def _not_finished(study: Study, cell: Cell) -> list[str]:
    """A sentence each for a cell's failed, unfinished and diverged runs: how far they are, and why they stopped."""
    runs = study.runs
    runs = runs[(runs["algo"] == cell.algo) & (runs["env"] == cell.env) & (runs["arm"] == cell.arm)].sort_values("seed")
    failed = runs[runs["status"] == Status.FAILED]
    waiting = runs[~counts(runs) & (runs["status"] != Status.FAILED)]
    groups = (
        ("failed", failed, lambda r: f"at {_reached(r)}: {r.failure if isinstance(r.failure, str) else 'no message'}"),
        ("unfinished", waiting, lambda r: f"{r.status}, {_reached(r)}"),
        (
            "diverged",
            runs[runs["counts_as"] == Outcome.DIVERGED],
            lambda r: f"at {_reached(r)}, its last value carried forward",
        ),
    )
    where, found = f"{algorithm_name(cell.algo)}, {task_name(cell.env)}, {actor_name(cell.arm)}", []
    for word, group, describe in groups:
        if len(group):
            each = [f"seed {r.seed} {describe(r)}" for r in group.head(MOST).itertuples()]
            more = [f"and {len(group) - MOST} more"] if len(group) > MOST else []
            found.append(f"{where}: {len(group)} of {len(runs)} runs {word} ({'; '.join(each + more)}).")
    return found


def _reached(run: object) -> str:
    step = getattr(run, "step", None)
    return f"{0 if pd.isna(step) else int(step):,} of {int(run.total_steps):,} steps"  # type: ignore[attr-defined]


def _of_task(study: Study, every: list[Cell], algo: str, env: str, claims: Claims) -> list[str]:
    here = select(every, algo, env)
    name, paper = f"{algorithm_name(algo)}, {task_name(env)}", tuple(cell.arm for cell in here if cell.paper)
    phrases = confounds(study, algo, env, paper) if paper else []
    found = [f"{name}: settings differ between actors: {phrase}." for phrase in phrases]
    counts = {cell.n for cell in here if cell.n}
    if len(counts) > 1:
        shown = ", ".join(f"{actor_name(cell.arm)} {cell.n}" for cell in here if cell.n)
        found.append(f"{name}: unequal numbers of seeds: {shown}.")
    for cell in here:
        if np.isnan(cell.returns).any():
            found.append(
                f"{name}, {actor_name(cell.arm)}: the seeds were not all evaluated at the same steps; curves show n by "
                "step, and the maximum of the mean takes the shared steps only."
            )
    if env not in claims.tasks:
        found.append(f"{name}: no claim is about this task; it is drawn and tabulated only.")
    if scale(every, algo, env, claims) is None:
        found.append(f"{name}: no reference score, so it has no part in what is computed over tasks.")
    return found
