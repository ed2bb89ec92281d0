"""What a run is an arm of, and the refusal of arms that mix configurations.

An *arm* is what a reader compares: a label under the task's own spike coding. A run of the paper's actor whose keys
were changed, or under the other coding, or of another actor under a paper actor's name, is an arm of its own name and
never passes for the paper's actor.
"""

from __future__ import annotations

from typing import Any

from analysis.data.errors import InputError
from analysis.data.flatten import differing_keys
from analysis.data.names import ACTORS
from analysis.data.reading import Run

MOST_KEYS = 10


def arm_of(run: Run) -> tuple[str, bool]:
    """The arm's name, and whether it is the paper's actor as the paper has it."""
    manifest = run.manifest
    label, actor = str(manifest["label"]), str(manifest["actor"])
    name, changed = label, manifest.get("changed_keys") or {}
    natural = manifest["encoder"] in ("none", run.config["env"].get("spike_coding", manifest["encoder"]))
    if label in ACTORS and label != actor:
        name += f" (actor: {actor})"
    elif changed and label == actor:
        name += f" (changed: {', '.join(sorted(changed))})"
    if not natural:
        name += f" [{manifest['encoder']}]"
    return name, label == actor and not changed and natural


def refuse_mixed_arms(runs: list[Run]) -> None:
    """Every run of one folder, and of one algorithm, task and arm, has one configuration; every seed is there once.

    Raises:
        InputError: two runs of one arm differ (with the keys), or are the same seed in two folders.
    """
    first: dict[tuple[str, ...], Run] = {}
    for run in runs:
        manifest = run.manifest
        arm = (manifest["algo"], manifest["env"], arm_of(run)[0])
        for place in ((run.path.rpartition("/")[0],), arm):
            other = first.setdefault(place, run)
            if manifest["cell_hash"] != other.manifest["cell_hash"]:
                where, names = _where(other, run)
                raise InputError(
                    f"runs/{where} mixes two configurations: {names} differ in {_differences(other, run)}. "
                    "Move one of them to a label or a study of its own."
                )
        twin = first.setdefault((*arm, f"seed {manifest['seed']}"), run)
        if twin is not run:
            where, names = _where(twin, run)
            raise InputError(f"runs/{where} has seed {manifest['seed']} twice: {names}. Move one of them away.")


def _where(a: Run, b: Run) -> tuple[str, str]:
    """The folder that both runs lie in, and each run's place below it."""
    left, right = a.path.split("/"), b.path.split("/")
    same = next(i for i in range(len(left)) if left[: i + 1] != right[: i + 1])
    return "/".join(left[:same]), f"{'/'.join(left[same:])} and {'/'.join(right[same:])}"


def _differences(a: Run, b: Run) -> str:
    found = differing_keys(_described(a), _described(b))
    shown = [f"{key}: {old} against {new}" for key, old, new in found[:MOST_KEYS]]
    more = [f"and {len(found) - MOST_KEYS} more keys"] if len(found) > MOST_KEYS else []
    return "; ".join(shown + more) or "no key of config.yaml"


def _described(run: Run) -> dict[str, Any]:
    """What must agree between seeds of one arm: the configuration, and the engine of the code."""
    return run.config | {"engine": run.manifest.get("engine")}
