"""Configurations for the actors' tests, from the YAML files that users edit."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml

from src.config import ExperimentConfig, validate

CONF = Path(__file__).parents[2] / "conf"


def configuration(
    actor: str | dict[str, Any] = "bptsan", encoder: str = "deterministic", **overrides: Any
) -> ExperimentConfig:
    """An experiment on Hopper; overrides are dotted keys with ``__`` for the dot, e.g. ``actor__time_steps=1``."""
    composed: dict[str, Any] = {
        "actor": actor if isinstance(actor, dict) else _load("actor", actor),
        "encoder": _load("encoder", encoder),
        "env": _load("env", "hopper"),
        "algo": _load("algo", "td3"),
        "protocol": _load("protocol", "smoke"),
        "logger": _load("logger", "none"),
        "normalize_observations": True,
        "normalization_clip": 3.0,
        "seed": 0,
        "threads": 1,
        "device": "cpu",
        "study": "test",
        "label": None,
        "results_dir": "results",
        "on_conflict": "refuse",
        "keep_replay": False,
        "dry_run": False,
    }
    composed["algo"]["actor_learning_rate"] = 1e-3
    composed["encoder"]["coding"] = {"task": "poisson"}.get(encoder, encoder)
    for key, value in overrides.items():
        *path, last = key.split("__")
        node = composed
        for part in path:
            node = node[part]
        node[last] = value
    return validate(composed)


def _load(group: str, name: str) -> dict[str, Any]:
    loaded = yaml.safe_load((CONF / group / f"{name}.yaml").read_text())
    return {key: (float(value) if _is_float(value) else value) for key, value in loaded.items()}


def _is_float(value: Any) -> bool:
    if not isinstance(value, str):
        return False
    try:
        float(value)
    except ValueError:
        return False
    return True
