"""What names a run: its hashes, label and path, on one frozen object that is made once, when the run is composed.

A hash covers what changes the numbers of a run. Left out are logging, paths, names of studies, labels and protocols,
what happens to an existing directory, how often checkpoints are taken, and ``total_steps`` (a longer run begins with
the shorter one); and ``blas``, which moves last bits as another machine does: the manifest says it. Left out too is
``encoder.name``: ``encoder=task`` and ``encoder=poisson`` are the same run where the task's coding is poisson.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Mapping, Set
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

from src.config.schema import ENGINE, ExperimentConfig
from src.config.validation import to_dict, validate
from src.paths import repository_path

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
#: Dotted keys that came after runs had been trained, each with the values that mean the behaviour before it. Such a
#: value enters neither a hash nor a comparison, so that the runs of before stay what they are.
ADDED_KEYS: Mapping[str, tuple[Any, ...]] = {
    "backend": ("auto", "fast"),
    "actor.coding": ("encoder",),
    "actor.neuron": ("clif",),
    "actor.dn.theta_v": (-0.172,),
    "actor.dn.theta_u": (0.529,),
    "actor.dn.theta_r": (0.021,),
    "actor.dn.theta_s": (0.132,),
    "actor.output_lateral": ("none",),
    "actor.output_lateral_bias": (True,),
    "actor.readout": ("rate",),
    "actor.readout_decay": (1.0,),
    "encoder.input_map": ("none",),
}
#: A longer label is cut here and told apart by a hash of the whole.
LONGEST_LABEL = 100


@dataclass(frozen=True)
class Run:
    """One run of a grid.

    Attributes:
        config: everything that the run does.
        changed_keys: dotted keys whose values differ from those of the chosen options, whatever the label.
    """

    config: ExperimentConfig
    changed_keys: Mapping[str, Any] = field(default_factory=dict)

    @property
    def label(self) -> str:
        """The variant's name in paths and reports; the actor's own where nothing was changed."""
        return self.config.label or self.config.actor.name

    @cached_property
    def path(self) -> Path:
        """``results/<study>/runs/<algo>/<env>/<label>/<encoder>/seed_<k>``."""
        config = self.config
        study = repository_path(config.results_dir) / config.study
        variant = Path(config.algo.name) / config.env.name / self.label / config.encoder.coding
        return study / "runs" / variant / f"seed_{config.seed}"

    @property
    def name(self) -> str:
        """``td3/hopper/bptsan/poisson/seed_2``."""
        return "/".join(self.path.parts[-5:])

    @cached_property
    def hashed(self) -> dict[str, Any]:
        """The dotted keys that change numbers, with their values."""
        return hashed_values(to_dict(self.config))

    @cached_property
    def configuration_hash(self) -> str:
        """SHA-256 over everything that changes the numbers, the seed included, except ``total_steps``."""
        return _hash(self.hashed)

    @cached_property
    def cell_hash(self) -> str:
        """The same without the seed: equal for all seeds of one configuration."""
        return _hash({key: value for key, value in self.hashed.items() if key != "seed"})

    def to_dict(self) -> dict[str, Any]:
        """Plain containers, for another process."""
        return {"config": to_dict(self.config), "changed_keys": dict(self.changed_keys)}

    @staticmethod
    def from_dict(content: Mapping[str, Any]) -> Run:
        """The inverse of :meth:`to_dict`.

        Raises:
            ConfigurationError: the configuration is none of this code.
        """
        return Run(validate(content["config"]), content["changed_keys"])


class Difference(NamedTuple):
    """One key whose value differs; ``None`` also stands for a key that one side lacks."""

    key: str
    old: Any
    new: Any

    def __str__(self) -> str:
        return f"{self.key}: {self.old} -> {self.new}"


def differences(old: Mapping[str, Any], new: Mapping[str, Any]) -> list[Difference]:
    """The keys of two flat mappings that differ, in alphabetical order."""
    return [
        Difference(key, old.get(key), new.get(key))
        for key in sorted(old.keys() | new.keys())
        if old.get(key) != new.get(key)
    ]


def hashed_values(content: Mapping[str, Any]) -> dict[str, Any]:
    """Dotted keys and values of all that changes numbers in a configuration (plain containers)."""
    flat = flatten({key: value for key, value in content.items() if key not in _EXCLUDED}, _EXCLUDED)
    return {key: value for key, value in flat.items() if value not in ADDED_KEYS.get(key, ())}


def flatten(nested: Mapping[str, Any], excluded: Set[str] = frozenset(), prefix: str = "") -> dict[str, Any]:
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


def variant_label(actor: str, changed: Mapping[str, Any]) -> str:
    """``bptsan-lateral.radius=4``: no variant passes for the paper's own actor."""
    if not changed:
        return actor
    label = f"{actor}-" + ",".join(f"{key.removeprefix('actor.')}={_compact(value)}" for key, value in changed.items())
    safe = re.sub(r"[^A-Za-z0-9_.,=+\[\]-]", "_", label)
    if safe == label and len(label) <= LONGEST_LABEL:
        return label
    return f"{safe[:LONGEST_LABEL]}-{hashlib.sha256(label.encode()).hexdigest()[:8]}"


def _compact(value: Any) -> str:
    """As in JSON, strings without their quotes."""
    if isinstance(value, list):
        return "[" + ",".join(_compact(item) for item in value) + "]"
    return value if isinstance(value, str) else json.dumps(value)


def _hash(flat: Mapping[str, Any]) -> str:
    canonical = json.dumps({"engine": ENGINE, **flat}, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(canonical.encode()).hexdigest()
