"""Where the numbers come from: versions, commits, processors, hashes, and which runs are missing."""

from __future__ import annotations

import json
from typing import Any

import pandas as pd

from analysis.data.names import (
    actor_name,
    algorithm_name,
    in_order,
    ordered_algorithms,
    ordered_arms,
    ordered_tasks,
    task_name,
)
from analysis.data.outcome import Outcome
from analysis.data.study import Study
from analysis.tables import Column, Table, number, text

_WHERE: list[Column] = [("algorithm", "Algorithm", text), ("task", "Task", text), ("actor", "Actor", text)]


def _seeds(values: pd.Series) -> str:
    """Sorted seeds, runs of neighbours as ``0–4``."""
    numbers = sorted(int(v) for v in values)
    parts: list[list[int]] = []
    for number_ in numbers:
        if parts and parts[-1][1] == number_ - 1:
            parts[-1][1] = number_
        else:
            parts.append([number_, number_])
    return ", ".join(str(a) if a == b else f"{a}–{b}" for a, b in parts)


def _reached(run: Any) -> str:
    """``3: running, 50,000 of 100,000``."""
    return f"{run.seed}: {run.status}, {0 if pd.isna(run.step) else int(run.step):,} of {run.total_steps:,}"


def status_table(study: Study) -> Table:
    """Which seeds of each cell are finished, diverged, unfinished, missing, and which cells are refused."""
    rows, runs = [], study.runs
    for algo in ordered_algorithms({*runs["algo"], *(cell.algo for cell in study.refused)}):
        of_algo = runs[runs["algo"] == algo]
        expected = set(of_algo["seed"])
        refused = {(cell.env, cell.arm): cell.seeds for cell in study.refused if cell.algo == algo}
        for env in ordered_tasks({*of_algo["env"], *(env for env, _ in refused)}):
            for arm in ordered_arms({*of_algo["arm"], *(arm for _, arm in refused)}):
                seeds = refused.get((env, arm), ())
                mine = of_algo[(of_algo["env"] == env) & (of_algo["arm"] == arm)]
                by = {kind: mine.loc[mine["counts_as"] == kind, "seed"] for kind in Outcome}
                states = mine[mine["counts_as"] == Outcome.UNFINISHED]
                reached = "; ".join(map(_reached, states.itertuples()))
                rows.append(
                    {
                        "algo": algo,
                        "env": env,
                        "arm": arm,
                        "algorithm": algorithm_name(algo),
                        "task": task_name(env),
                        "actor": actor_name(arm),
                        "finished": _seeds(by[Outcome.FINISHED]),
                        "diverged": _seeds(by[Outcome.DIVERGED]),
                        "unfinished": reached,
                        "missing": _seeds(pd.Series(sorted(expected - {*mine["seed"], *seeds}))),
                        "refused": _seeds(pd.Series(sorted(set(seeds)))),
                    }
                )
    columns: list[Column] = [
        *_WHERE,
        ("finished", "Finished seeds", text),
        ("diverged", "Diverged", text),
        ("unfinished", "Unfinished (state, steps)", text),
        ("missing", "Missing", text),
        *([("refused", "Refused", text)] if study.refused else []),
    ]
    caption = (
        "Missing: seeds that another cell of the same algorithm has. Nothing is filled in for them, and nothing is "
        "cut to the shortest."
    )
    if study.refused:
        caption += " Refused: the cell mixes configurations; none of its runs counts or is drawn. The notes say which."
    frame = pd.DataFrame(rows, columns=["algo", "env", "arm", *(key for key, _, _ in columns)])
    return Table("runs", "provenance", "Which runs there are", caption, frame, columns, "There are no runs yet.")


def versions_table(study: Study) -> Table:
    """What ran: one row per distinct value."""
    rows, runs = [], study.runs

    def add(what: str, values: pd.Series) -> None:
        for value, count in values.dropna().astype(str).value_counts().sort_index().items():
            rows.append({"what": what, "value": value, "runs": count})

    if len(runs):
        add(
            "commit",
            runs["commit"]
            .astype(object)
            .where(runs["dirty"].fillna(False).ne(True), runs["commit"].astype(str) + " (with local changes)"),
        )
        versions = pd.DataFrame([json.loads(v) for v in runs["versions"]])
        for package in sorted(versions.columns):
            add(package, versions[package])
        for what in ("engine", "backend", "processor", "blas", "device", "threads"):
            values = runs[what]
            add(what, values.map(lambda v: int(v) if isinstance(v, float) and v == v and v.is_integer() else v))
    columns: list[Column] = [("what", "", text), ("value", "Value", text), ("runs", "Runs", number())]
    frame = pd.DataFrame(rows, columns=["what", "value", "runs"])
    return Table(
        "versions",
        "provenance",
        "Versions and machines",
        "As the runs' manifests record them.",
        frame,
        columns,
        folded=True,
    )


def cells_table(study: Study) -> Table:
    """The configuration hash of every cell (the same for all of its seeds)."""
    rows = []
    groups = dict(list(study.runs.groupby(["algo", "env", "arm"], sort=False)))
    for algo, env, arm in in_order(groups):
        group = groups[algo, env, arm]
        keys = json.loads(group["changed_keys"].iloc[0])
        rows.append(
            {
                "algorithm": algorithm_name(algo),
                "task": task_name(env),
                "actor": actor_name(arm),
                "encoder": group["encoder"].iloc[0],
                "hash": str(group["cell_hash"].iloc[0])[:16],
                "changed": ", ".join(f"{k}={v}" for k, v in sorted(keys.items())),
                "resumed": int(group["times_resumed"].fillna(0).sum()),
            }
        )
    columns: list[Column] = [
        *_WHERE,
        ("encoder", "Spike coding", text),
        ("hash", "Configuration hash", text),
        ("changed", "Changed keys", text),
        ("resumed", "Resumes", number()),
    ]
    caption = (
        "Seeds of one cell share the hash; mixed cells are refused. A cell with changed keys is a variant and enters "
        "no claim of the paper."
    )
    frame = pd.DataFrame(rows, columns=[key for key, _, _ in columns])
    return Table("cells", "provenance", "Configurations", caption, frame, columns, folded=True)
