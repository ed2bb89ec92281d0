"""What a reader must know before any number: how long the runs are, how many there are, what differs from the paper."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import pandas as pd
import yaml

from analysis.data.names import algorithm_name, ordered_algorithms, ordered_tasks, task_name
from analysis.data.outcome import Outcome
from analysis.data.study import Study, flat_configuration

FILE = Path(__file__).with_name("paper_protocol.yaml")


@cache
def protocol() -> dict[str, Any]:
    """The content of ``paper_protocol.yaml``."""
    content: dict[str, Any] = yaml.safe_load(FILE.read_text(encoding="utf-8"))
    return content


def overview(study: Study) -> dict[str, str]:
    """Sentences for the first screen: the ``title`` of the claims; ``status``, ``caution``, ``settings``, which may be
    empty.
    """
    lengths = sorted({int(steps) for steps in study.runs["training_steps"]})
    steps = int(protocol()["steps"])
    whole = not lengths or lengths == [steps]
    shown = " or ".join(f"{length:,}" for length in lengths)
    caution = (
        f"Runs of {shown} steps: the paper's claims are about {steps:,}, and nothing here speaks about them at that "
        "length."
    )
    return {
        "title": "The paper's claims" if whole else f"The claims at {shown} steps",
        "status": " ".join(_status(study, algo) for algo in ordered_algorithms(study.runs["algo"])),
        "caution": "" if whole else caution,
        "settings": _settings(study),
    }


def _status(study: Study, algo: str) -> str:
    """``TD3: runs of 100,000 steps (the paper: 1,000,000), 1–3 seeds per cell (10); 2 of 15 runs finished, ...``."""
    runs = study.runs[study.runs["algo"] == algo]
    lengths = " or ".join(f"{steps:,}" for steps in sorted({int(steps) for steps in runs["training_steps"]}))
    seeds = _range(runs.groupby(["env", "arm"]).size())
    done = runs["counts_as"].value_counts()
    words = [f"{done.get(Outcome.FINISHED, 0)} of {len(runs)} runs finished"]
    if diverged := int(done.get(Outcome.DIVERGED, 0)):
        words.append(f"{diverged} diverged")
    waiting = runs[runs["counts_as"] == Outcome.UNFINISHED]
    if len(waiting):
        furthest = int(waiting["step"].fillna(0).max())
        words.append(f"{len(waiting)} unfinished, the furthest at step {furthest:,}")
    if refused := sum(cell.algo == algo for cell in study.refused):
        words.append(f"{refused} more cell{'s' * (refused > 1)} refused for mixing configurations (see the notes)")
    return (
        f"{algorithm_name(algo)}: {lengths} steps a run (the paper: {protocol()['steps']:,}); {seeds} per cell started "
        f"(the paper: {protocol()['seeds']}); {', '.join(words)}."
    )


def _range(counts: pd.Series) -> str:
    low, high = int(counts.min()), int(counts.max())
    return f"{high} seed{'s' * (high != 1)}" if low == high else f"{low} to {high} seeds"


def _settings(study: Study) -> str:
    """The settings in which runs of the paper's actors differ from the paper's protocol, equal ones once."""
    found: dict[tuple[str, str, str], list[tuple[str, str]]] = {}
    paper = study.runs[study.runs["paper"].astype(bool)]
    cells = list(dict.fromkeys(zip(paper["algo"], paper["env"], paper["arm"])))
    for algo, env, arm in cells:
        expected = protocol()["settings"] | protocol()["of_algorithm"].get(algo, {})
        flat = flat_configuration(study, algo, env, arm)
        for key, value in expected.items():
            if key in flat and flat[key] != value:
                found.setdefault((key, _value(flat[key]), _value(value)), []).append((algo, env))
    if not cells:
        return ""
    everywhere = {(algo, env) for algo, env, _ in cells}
    parts = []
    for (key, ours, theirs), tasks in found.items():
        where = (
            "" if set(tasks) == everywhere else f" on {', '.join(map(task_name, ordered_tasks(e for _, e in tasks)))}"
        )
        parts.append(f"{key} {ours} (the paper: {theirs}){where}")
    if not parts:
        return "Settings as the paper's protocol has them, but for the number of steps and seeds above."
    return f"Settings that differ from the paper's protocol: {'; '.join(parts)}."


def _value(value: Any) -> str:
    return f"{value:,}" if isinstance(value, int) and not isinstance(value, bool) else str(value).lower()
