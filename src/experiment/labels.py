"""The label of a variant: which keys of actor, encoder or algorithm differ from that option's own YAML file.

So a changed actor never passes for the paper's: ``actor=bptsan actor.lateral.radius=4`` becomes
``bptsan-lateral.radius=4`` in paths and reports.
"""

from __future__ import annotations

import hashlib
import re
from functools import cache
from typing import Any

from omegaconf import OmegaConf

from src.config import ConfigurationError, ExperimentConfig, to_dict
from src.experiment.hashing import flatten
from src.experiment.machine import ROOT

#: A longer label is cut here and told apart by a hash of the whole.
LONGEST = 100
_METHOD_KEYS = ("normalize_observations", "normalization_clip")
_NOT_COMPARED = frozenset({"encoder.name", "encoder.coding"})  # the path shows the coding


def label_of(config: ExperimentConfig) -> str:
    """The explicit ``label`` where there is one, else the actor's name and what was changed."""
    return config.label if config.label is not None else _made(config.actor.name, changed_keys(config))


def changed_keys(config: ExperimentConfig) -> dict[str, Any]:
    """Dotted keys of actor, encoder, algo and env that differ from the option's own file, with their values.

    The normalisation of observations counts too: it belongs to the method, and every actor has it.

    Raises:
        ConfigurationError: an option's name has no file.
    """
    composed = to_dict(config)
    changed: dict[str, Any] = {}
    for group in ("actor", "encoder", "algo", "env"):
        own = _own_values(group, composed)
        for key, value in flatten({group: composed[group]}).items():
            if key not in _NOT_COMPARED and (key not in own or own[key] != value):
                changed[key] = value
    defaults = _defaults()
    return changed | {key: composed[key] for key in _METHOD_KEYS if composed[key] != defaults[key]}


def _own_values(group: str, composed: dict[str, Any]) -> dict[str, Any]:
    """The option's own values; ``${actor.learning_rate}`` follows the actor of this configuration."""
    option = _option(group, composed[group]["name"])
    values = flatten({group: option})
    if any(isinstance(value, str) and "${" in value for value in values.values()):
        whole = OmegaConf.create({**composed, group: option})
        resolved = OmegaConf.to_container(whole[group], resolve=True)
        assert isinstance(resolved, dict)
        values = flatten({group: resolved})
    if group == "actor":
        values.setdefault("actor.spikes", composed["actor"]["spikes"])
    return values


@cache
def _defaults() -> dict[str, Any]:
    content = OmegaConf.to_container(OmegaConf.load(ROOT / "conf" / "config.yaml"), resolve=False)
    assert isinstance(content, dict)
    return {str(key): value for key, value in content.items()}


@cache
def _option(group: str, name: str) -> dict[str, Any]:
    path = ROOT / "conf" / group / f"{name}.yaml"
    if not path.is_file():
        raise ConfigurationError(f"{group}.name: there is no conf/{group}/{name}.yaml; an option is named as its file.")
    option = OmegaConf.to_container(OmegaConf.load(path), resolve=False)
    assert isinstance(option, dict)
    return {str(key): value for key, value in option.items()}


def _made(actor: str, changed: dict[str, Any]) -> str:
    if not changed:
        return actor
    label = f"{actor}-" + ",".join(f"{key.removeprefix('actor.')}={_compact(value)}" for key, value in changed.items())
    safe = re.sub(r"[^A-Za-z0-9_.,=+\[\]-]", "_", label)
    if safe == label and len(label) <= LONGEST:
        return label
    return f"{safe[:LONGEST]}-{hashlib.sha256(label.encode()).hexdigest()[:8]}"


def _compact(value: Any) -> str:
    if value is None or isinstance(value, bool):
        return {None: "null", True: "true", False: "false"}[value]
    if isinstance(value, list):
        return "[" + ",".join(_compact(item) for item in value) + "]"
    return repr(value) if isinstance(value, float) else str(value)
