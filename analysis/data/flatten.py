"""Nested configurations as dotted keys, and the keys in which two of them differ."""

from __future__ import annotations

from typing import Any

#: Keys that change no number of a run: who it is, where it lies, how it is logged, how far it goes, when it saves.
IDENTITY = frozenset(
    {"seed", "study", "label", "results_dir", "on_conflict", "keep_replay", "dry_run", "sweeps", "protocol.name"}
    | {"protocol.total_steps", "protocol.checkpoint_interval", "actor.name", "encoder.name"}
)


def flatten(tree: dict[str, Any], prefix: str = "") -> dict[str, Any]:
    """``{"a": {"b": 1}}`` -> ``{"a.b": 1}``; lists are values."""
    flat: dict[str, Any] = {}
    for key, value in tree.items():
        name = f"{prefix}{key}"
        if isinstance(value, dict) and value:
            flat |= flatten(value, f"{name}.")
        else:
            flat[name] = value
    return flat


def differing_keys(
    a: dict[str, Any], b: dict[str, Any], ignore: frozenset[str] = IDENTITY
) -> list[tuple[str, Any, Any]]:
    """Sorted ``(key, value in a, value in b)`` where two nested configurations differ, but for identity and logging."""
    left, right = flatten(a), flatten(b)
    keys = sorted((left.keys() | right.keys()) - ignore)
    return [
        (key, left.get(key, "absent"), right.get(key, "absent"))
        for key in keys
        if not key.startswith("logger.") and left.get(key, "absent") != right.get(key, "absent")
    ]
