"""What a run is an arm of.

An *arm* is what a reader compares: a label under the task's own spike coding. A run of the paper's actor whose keys
were changed, or under the other coding, or of another actor under a paper actor's name, is an arm of its own name and
never passes for the paper's actor. An algorithm that is an option of another stands in the arm's name too: with and
without it are two arms of one algorithm, with one scale.
"""

from __future__ import annotations

from analysis.data.names import ACTORS
from analysis.data.reading import Run

#: Algorithms that are options of another: which one, and how the arm is called.
OPTIONS = {"td3_proxy": ("td3", "proxy target")}


def algorithm_of(run: Run) -> str:
    """The algorithm whose arms this run is compared with."""
    return algorithm_and_arm(run.manifest.algo, run.manifest.label)[0]


def algorithm_and_arm(algo: str, label: str) -> tuple[str, str]:
    """Under which algorithm, and by which name, a label stands that is trained by ``algo``."""
    if algo not in OPTIONS:
        return algo, label
    algorithm, option = OPTIONS[algo]
    return algorithm, f"{label} + {option}"


def arm_of(run: Run) -> tuple[str, bool]:
    """The arm's name, and whether it is the paper's actor as the paper has it."""
    manifest = run.manifest
    label = manifest.label
    actor = manifest.actor
    changed = manifest.changed_keys
    coding = run.settings.env.spike_coding or manifest.encoder
    if run.settings.actor.coding == "analog":  # whatever the task
        coding = "analog"
    natural = manifest.encoder in ("none", coding)
    option = manifest.algo in OPTIONS
    name = label
    if label in ACTORS and label != actor:
        name += f" (actor: {actor})"
    elif changed and label == actor:
        name += f" (changed: {', '.join(sorted(changed))})"
    if not natural:
        name += f" [{manifest.encoder}]"
    return algorithm_and_arm(manifest.algo, name)[1], label == actor and not changed and natural and not option
