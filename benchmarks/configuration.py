"""Configurations for benchmarks, composed by Hydra from ``conf/`` as the command composes them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from hydra import compose as hydra_compose
from hydra import initialize_config_dir
from omegaconf import OmegaConf

from src.config import ExperimentConfig, validate

CONF = Path(__file__).resolve().parents[1] / "conf"


def compose(*overrides: str, **choices: str) -> ExperimentConfig:
    """``compose("algo.batch_size=400", actor="popsan", env="ant")``."""
    with initialize_config_dir(str(CONF), version_base="1.3"):
        composed = hydra_compose("config", [*(f"{group}={option}" for group, option in choices.items()), *overrides])
    content: Any = OmegaConf.to_container(composed, resolve=True)
    return validate(content)
