"""Configurations for the actors' tests: spikes by deterministic coding unless asked otherwise."""

from __future__ import annotations

from typing import Any

from src.config.schema import ExperimentConfig
from tests.helpers import make_config


def configuration(
    actor: str | dict[str, Any] = "bptsan", encoder: str = "deterministic", **overrides: Any
) -> ExperimentConfig:
    """An experiment on Hopper; overrides are dotted keys with ``__`` for the dot, e.g. ``actor__time_steps=1``."""
    changes = {key.replace("__", "."): value for key, value in overrides.items()}
    if isinstance(actor, dict):
        return make_config({"actor": actor, **changes}, encoder=encoder)
    return make_config(changes, actor=actor, encoder=encoder)
