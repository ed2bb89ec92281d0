"""The end of a sweep: what became of every cell that was started, from the manifests, whatever the launcher."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from rich.console import Console

from src.experiment.lock import held_here
from src.experiment.machine import ROOT
from src.experiment.manifest import ManifestError
from src.experiment.outcome import DONE, FAILED, INTERRUPTED
from src.experiment.plan import Cell


class Ending(NamedTuple):
    """``state``: a status of the manifest, ``busy``, ``not started`` or ``not finished``; ``read``: where to look."""

    name: str
    state: str
    why: str
    read: Path


def ending(cell: Cell, killed: str | None = None) -> Ending:
    """How a cell stands now. ``killed`` is what a launcher saw where the manifest may not know."""
    run = cell.run
    try:
        manifest = run.read_manifest()
    except ManifestError as error:
        return Ending(run.name, "failed", str(error), run.path)
    log = run.state / "log.txt"
    if manifest is not None and manifest.status == "failed":
        failure = run.path / "failure.txt"
        why = manifest.failure.message if manifest.failure else "?"
        return Ending(run.name, "failed", why, failure if failure.exists() else log)
    if manifest is not None and manifest.status != "running":
        why = manifest.failure.message if manifest.failure else ""
        return Ending(run.name, manifest.status, why, run.path)
    if held_here(run.path):
        return Ending(run.name, "busy", "held by a live process", log)
    return Ending(run.name, "not finished", killed or "it ended without a word", log)


def close(endings: Sequence[Ending], busy_before: int, console: Console) -> int:
    """Print what is not well, each with where to read why, and return the exit code of the sweep."""
    count: dict[str, int] = {}
    for each in endings:
        count[each.state] = count.get(each.state, 0) + 1
    if busy_before:
        count["left to another launcher"] = busy_before
    console.print("finished: " + ", ".join(f"{number} {state}" for state, number in count.items()), highlight=False)
    unwell = [each for each in endings if each.state not in ("complete", "interrupted", "not started")]
    width = max((len(each.state) for each in unwell), default=0)
    for each in unwell:  # unwrapped lines: a path can be copied, a line can be searched for
        print(f"{each.state:{width}}  {each.name}  {each.why}\n{'':{width}}  read {_shown(each.read)}", flush=True)
    return exit_code(count)


def exit_code(count: Mapping[str, int]) -> int:
    """1 where something failed, else 75 where something is left to do, else 0."""
    if count.get("failed") or count.get("not finished"):
        return FAILED
    if any(count.get(state) for state in ("interrupted", "not started", "busy", "left to another launcher")):
        return INTERRUPTED
    return DONE


def _shown(path: Path) -> str:
    return str(path.relative_to(ROOT)) if path.is_relative_to(ROOT) else str(path)
