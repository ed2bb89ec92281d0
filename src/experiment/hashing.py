"""Hashes of a configuration: equal exactly where the numbers of the run must be equal.

Left out is what changes no number: logging, paths, names of studies, labels and protocols, what happens to an existing
directory, how often checkpoints are taken, and ``total_steps`` (a longer run begins with the shorter one). Left out too
is ``encoder.name``: ``encoder=task`` and ``encoder=poisson`` are the same run where the task's coding is poisson.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Set
from typing import Any, NamedTuple

from src.config import ENGINE, ExperimentConfig, to_dict

_EXCLUDED = frozenset(
    {
        "logger",
        "results_dir",
        "study",
        "label",
        "on_conflict",
        "dry_run",
        "keep_replay",
        "sweeps",
        "blas",
        "keep_best",
        "protocol.name",
        "protocol.total_steps",
        "protocol.checkpoint_interval",
        "encoder.name",
    }
)

#: Keys that came later, and their values that change no number of the runs before them.
_LATER_KEYS = {"backend": frozenset({"auto", "fast"})}


class Difference(NamedTuple):
    """One key whose value differs; ``None`` also stands for a key that one side lacks."""

    key: str
    old: Any
    new: Any


def configuration_hash(config: ExperimentConfig) -> str:
    """SHA-256 over everything that changes the numbers, the seed included, except ``total_steps``."""
    return _hash(numbers(to_dict(config)))


def cell_hash(config: ExperimentConfig) -> str:
    """The same without the seed: equal for all seeds of one cell."""
    return _hash({key: value for key, value in numbers(to_dict(config)).items() if key != "seed"})


def differing_keys(old: dict[str, Any], new: dict[str, Any]) -> list[Difference]:
    """The keys of two configurations (plain containers) that change numbers and differ, in alphabetical order."""
    before, after = numbers(old), numbers(new)
    return [
        Difference(key, before.get(key), after.get(key))
        for key in sorted(before.keys() | after.keys())
        if before.get(key) != after.get(key)
    ]


def numbers(composed: dict[str, Any]) -> dict[str, Any]:
    """Dotted keys and values of all that changes numbers."""
    flat = flatten({key: value for key, value in composed.items() if key not in _EXCLUDED}, _EXCLUDED)
    return {key: value for key, value in flat.items() if value not in _LATER_KEYS.get(key, ())}


def flatten(nested: dict[str, Any], excluded: Set[str] = frozenset(), prefix: str = "") -> dict[str, Any]:
    """``{"a": {"b": 1}}`` as ``{"a.b": 1}``; an empty mapping stays, so that it differs from a missing one."""
    flat: dict[str, Any] = {}
    for key, value in nested.items():
        path = f"{prefix}{key}"
        if path in excluded:
            continue
        if isinstance(value, dict) and value:
            flat |= flatten(value, excluded, f"{path}.")
        else:
            flat[path] = value
    return flat


def _hash(flat: dict[str, Any]) -> str:
    canonical = json.dumps({"engine": ENGINE, **flat}, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(canonical.encode()).hexdigest()
