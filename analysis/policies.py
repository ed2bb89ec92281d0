"""The section of the page that shows watched policies: raster and frames of one per actor and task."""

from __future__ import annotations

import base64
import json
from pathlib import Path
from typing import Any
from urllib.parse import quote

from analysis.data.names import actor_name, algorithm_name, task_name

CAPTION = (
    "One episode of a trained policy per actor and task, by python -m src.watch: six frames of it; left the spikes of "
    "the first decisions at every time step (of an MLP its activations), right the firing rates of the whole episode, "
    "beneath them actions and reward. One episode of one seed is an illustration, not a result."
)
_WORDS = {"frames": "Frames", "raster": "Raster"}


def policies_section(folder: Path) -> dict[str, Any] | None:
    """What the templates print, from ``collected/policies.json``; None where no policy of the study was watched."""
    try:
        found = json.loads((folder / "collected/policies.json").read_bytes())
    except FileNotFoundError:
        return None
    names = "; ".join(_title(policy) for policy in found["left_out"])
    left_out = f"Left out, since all pictures together stay under {found['megabytes']} MB: {names}." if names else ""
    return {
        "caption": CAPTION,
        "left_out": left_out,
        "shown": [
            {
                "title": _title(policy),
                "caption": _caption(policy),
                "pictures": [_picture(policy, picture, folder) for picture in policy["pictures"]],
                "originals": [
                    {"name": name, "url": quote(f"../runs/{policy['path']}/watch/{name}")}
                    for name in policy["originals"]
                ],
            }
            for policy in found["shown"]
        ],
    }


def _title(policy: dict[str, Any]) -> str:
    return f"{algorithm_name(policy['algo'])}, {task_name(policy['env'])}, {actor_name(policy['arm'])}"


def _caption(policy: dict[str, Any]) -> str:
    """``AAN, seed 0: return 11,859 in 1,000 steps (episode of seed 0, policy of step 1,000,000, ...).``"""
    words = f"{actor_name(policy['arm'])}, seed {policy['seed']}"
    if len(policy["seeds"]) > 1:
        words += f" (watched: {', '.join(map(str, policy['seeds']))})"
    if policy["return"]:
        words += f": return {policy['return']} in {policy['steps']} steps"
    return f"{words}; {policy['policy']}." if policy["policy"] else f"{words}."


def _picture(policy: dict[str, Any], picture: dict[str, Any], folder: Path) -> dict[str, Any]:
    content = (folder / "collected" / picture["file"]).read_bytes()
    return {
        "kind": picture["kind"],
        "uri": "data:image/png;base64," + base64.b64encode(content).decode("ascii"),
        "file": f"../collected/{picture['file']}",
        "width": picture["width"],
        "height": picture["height"],
        "alt": f"{_WORDS[picture['kind']]} of an episode of {_caption(policy)}",
    }
