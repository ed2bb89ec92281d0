"""Cells that are refused: their runs are not seeds of one configuration. The rest of the study is not touched."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass
from typing import Any

from analysis.data.arms import algorithm_of, arm_of
from analysis.data.flatten import differing_keys
from analysis.data.reading import Run

MOST_KEYS = 10


@dataclass(frozen=True)
class Refused:
    """A cell none of whose runs count or are drawn: ``seeds`` in order, and ``reason``, one or more sentences."""

    algo: str
    env: str
    arm: str
    seeds: tuple[int, ...]
    reason: str


def without_mixed(runs: list[Run]) -> tuple[list[Run], list[Refused]]:
    """The runs of the sound cells, and the cells that are refused.

    All runs of one folder, and of one algorithm, task and arm, have one configuration, and every seed is there once.
    A cell for which that does not hold is refused as a whole: which of its runs are the right ones, nobody here knows.
    """
    cells: dict[tuple[str, str, str], list[Run]] = defaultdict(list)
    folders: dict[str, list[Run]] = defaultdict(list)
    for run in runs:
        cells[cell_of(run)].append(run)
        folders[run.path.rpartition("/")[0]].append(run)
    reasons: dict[tuple[str, str, str], str] = {}
    for together in (*folders.values(), *cells.values()):
        if reason := _mixed(together):
            for run in together:
                reasons.setdefault(cell_of(run), reason)
    refused = [
        Refused(*cell, tuple(sorted(run.manifest.seed for run in cells[cell])), reason)
        for cell, reason in reasons.items()
    ]
    return [run for run in runs if cell_of(run) not in reasons], refused


def cell_of(run: Run) -> tuple[str, str, str]:
    """Algorithm, task and arm."""
    return algorithm_of(run), run.manifest.env, arm_of(run)[0]


def _mixed(runs: list[Run]) -> str:
    """Why these runs are not the seeds of one cell; empty if they are."""
    first = runs[0]
    seeds: dict[tuple[str, int], Run] = {}
    for run in runs:
        if run.manifest.cell_hash != first.manifest.cell_hash:
            where, names = folder_and_names(first, run)
            differing = listed(differences(first, run)) or "their cell_hash, but in no key of config.yaml"
            return (
                f"runs/{where} mixes two configurations: {names} differ in {differing}. "
                "Move one of them to a label or a study of its own."
            )
        twin = seeds.setdefault((cell_of(run)[2], run.manifest.seed), run)
        if twin is not run:
            where, names = folder_and_names(twin, run)
            return f"runs/{where} has seed {run.manifest.seed} twice: {names}. Move one of them away."
    return ""


def folder_and_names(a: Run, b: Run) -> tuple[str, str]:
    """The folder that both runs lie in, and each run's path below it."""
    left = a.path.split("/")
    right = b.path.split("/")
    same = next((i for i in range(len(left)) if left[: i + 1] != right[: i + 1]), len(left))
    return "/".join(left[:same]), f"{'/'.join(left[same:])} and {'/'.join(right[same:])}"


def differences(a: Run, b: Run) -> list[tuple[str, Any, Any]]:
    """The keys in which two runs differ; the engine of the code counts as one."""
    hashed = [[*run.manifest.hashed_keys, "engine"] if run.manifest.hashed_keys else None for run in (a, b)]
    left = a.config | {"engine": a.manifest.engine}
    right = b.config | {"engine": b.manifest.engine}
    return differing_keys(left, right, hashed[0], hashed[1], exempt=frozenset({"seed"}))


def listed(found: list[tuple[str, Any, Any]]) -> str:
    """``key: old against new; ...``, at most ``MOST_KEYS`` of them; empty for none."""
    shown = [f"{key}: {old} against {new}" for key, old, new in found[:MOST_KEYS]]
    more = [f"and {len(found) - MOST_KEYS} more keys"] if len(found) > MOST_KEYS else []
    return "; ".join(shown + more)
