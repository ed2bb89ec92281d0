"""Nested configurations as dotted keys, and the keys that change numbers in which two of them differ."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

#: Keys that change no number of a run, for manifests that do not list their ``hashed_keys``: the rule that the training
#: code hashed by until it wrote that list.
NOT_HASHED = frozenset(
    {"study", "label", "results_dir", "on_conflict", "keep_replay", "dry_run", "sweeps", "logger", "encoder.name"}
    | {"protocol.name", "protocol.total_steps", "protocol.checkpoint_interval", "blas", "keep_best"}
)
#: Hashed, and yet no difference between two arms: which actor, under which seed.
IDENTITY = frozenset({"seed", "actor.name"})
ABSENT = "absent"


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
    a: dict[str, Any],
    b: dict[str, Any],
    hashed_a: Collection[str] | None = None,
    hashed_b: Collection[str] | None = None,
    exempt: frozenset[str] = IDENTITY,
) -> list[tuple[str, Any, Any]]:
    """``(key, value in a, value in b)`` where two nested configurations differ in what changes numbers.

    Kinds come first, since the others follow from them; then by name.

    Args:
        a: a resolved configuration.
        b: another.
        hashed_a: the keys of ``a`` that change numbers, as its manifest lists them; None: ``NOT_HASHED`` rules.
        hashed_b: the same of ``b``. A key that either of the two hashes is compared; a key added by a later version
            of the training code is hashed only where it departs from the behaviour before it.
        exempt: keys that are not compared.
    """
    left = flatten(a)
    right = flatten(b)
    keys = (_hashed(left, hashed_a) | _hashed(right, hashed_b)) - exempt
    return [
        (key, left.get(key, ABSENT), right.get(key, ABSENT))
        for key in sorted(keys, key=lambda key: (not key.endswith(".kind"), key))  # what the others follow from, first
        if left.get(key, ABSENT) != right.get(key, ABSENT)
    ]


def _hashed(flat: dict[str, Any], listed: Collection[str] | None) -> set[str]:
    if listed is not None:
        return set(listed) & flat.keys()
    return {key for key in flat if key not in NOT_HASHED and key.partition(".")[0] not in NOT_HASHED}
