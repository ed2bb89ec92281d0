"""Configurations for benchmarks, composed by Hydra from ``conf/`` as the command composes them."""

from __future__ import annotations

from typing import Any

from omegaconf import OmegaConf

from src.config.compose import composed_from
from src.config.schema import ExperimentConfig
from src.config.validation import validate


def compose(*overrides: str, **choices: str) -> ExperimentConfig:
    """``compose("algo.batch_size=400", actor="popsan", env="ant")``."""
    composed = composed_from(*(f"{group}={option}" for group, option in choices.items()), *overrides)
    content: Any = OmegaConf.to_container(composed, resolve=True)
    return validate(content)
