"""What a run is an arm of.

An *arm* is what a reader compares: a label under the task's own spike coding. A run of the paper's actor whose keys
were changed, or under the other coding, or of another actor under a paper actor's name, is an arm of its own name and
never passes for the paper's actor.
"""

from __future__ import annotations

from analysis.data.names import ACTORS
from analysis.data.reading import Run


def arm_of(run: Run) -> tuple[str, bool]:
    """The arm's name, and whether it is the paper's actor as the paper has it."""
    manifest = run.manifest
    label = manifest.label
    actor = manifest.actor
    changed = manifest.changed_keys
    natural = manifest.encoder in ("none", run.settings.env.spike_coding or manifest.encoder)
    name = label
    if label in ACTORS and label != actor:
        name += f" (actor: {actor})"
    elif changed and label == actor:
        name += f" (changed: {', '.join(sorted(changed))})"
    if not natural:
        name += f" [{manifest.encoder}]"
    return name, label == actor and not changed and natural
