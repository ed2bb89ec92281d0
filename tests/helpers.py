"""Configurations and progress for tests. Every configuration of a test is composed by Hydra from ``conf/``."""

from __future__ import annotations

import copy
import dataclasses
from pathlib import Path
from typing import Any

from omegaconf import OmegaConf

from src.config.compose import composed_from
from src.config.schema import ExperimentConfig
from src.config.validation import validate

ROOT = Path(__file__).resolve().parents[1]
CONF = ROOT / "conf"
CHOICES = {"protocol": "smoke", "logger": "none"}


def plain_config(overrides: dict[str, Any] | None = None, **choices: str) -> dict[str, Any]:
    """A resolved configuration as plain containers: ``plain_config({"actor.time_steps": 1}, env="ant")``."""
    base = copy.deepcopy(composed_from(*(f"{group}={name}" for group, name in (CHOICES | choices).items())))
    for key, value in (overrides or {}).items():
        OmegaConf.update(base, key, value, merge=False, force_add=True)  # a mapping takes the place of the old one
    plain: Any = OmegaConf.to_container(base, resolve=True)
    return plain


def make_config(overrides: dict[str, Any] | None = None, **choices: str) -> ExperimentConfig:
    """A validated configuration: ``make_config({"protocol.total_steps": 450}, actor="aan")``."""
    return validate(plain_config(overrides, **choices))


def tiny(results_dir: Path, overrides: dict[str, Any] | None = None, **choices: str) -> ExperimentConfig:
    """A run of a few seconds with small networks: every phase of the protocol in 450 steps."""
    short = {
        "protocol.total_steps": 450,
        "protocol.start_steps": 150,
        "protocol.update_after": 100,
        "protocol.evaluation_interval": 150,
        "protocol.evaluation_episodes": 2,
        "protocol.checkpoint_interval": 150,
        "algo.batch_size": 16,
        "algo.critic_hidden_sizes": [32, 32],
        "actor.hidden_sizes": [32, 32],
        "env.max_episode_steps": 60,
        "results_dir": str(results_dir),
        "study": "test",
    }
    return make_config(short | (overrides or {}), **choices)


class Silent:
    """A progress display that remembers instead of showing."""

    def __init__(self) -> None:
        self.rates: list[float] = []
        self.notes: list[str] = []

    def update(self, step: int, last_return: float | None, steps_per_second: float) -> None:
        self.rates.append(steps_per_second)

    def note(self, text: str) -> None:
        self.notes.append(text)


replace = dataclasses.replace
