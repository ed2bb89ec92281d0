"""Configurations and progress for tests, composed as the command line composes them."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

from omegaconf import OmegaConf

from src.config import ExperimentConfig, validate

CONF = Path(__file__).resolve().parents[1] / "conf"
GROUPS = {
    "algo": "td3",
    "env": "hopper",
    "actor": "bptsan",
    "encoder": "task",
    "protocol": "smoke",
    "logger": "none",
}


def make_config(overrides: dict[str, Any] | None = None, **choices: str) -> ExperimentConfig:
    """A validated configuration: ``make_config({"protocol.total_steps": 450}, actor="aan")``."""
    base: Any = OmegaConf.load(CONF / "config.yaml")
    base.pop("defaults")
    base.pop("hydra")
    base.update({"logger": None, "sweeps": None})
    for group, default in GROUPS.items():
        base[group] = OmegaConf.load(CONF / group / f"{choices.get(group, default)}.yaml")
    for key, value in (overrides or {}).items():
        OmegaConf.update(base, key, value)
    plain: Any = OmegaConf.to_container(base, resolve=True)
    return validate(plain)


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
