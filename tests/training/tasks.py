"""The tasks of conf/env, as the configuration's own dataclass, and helpers that several tests share."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import torch

from src.config.schema import EnvConfig
from src.training.collection import Transitions
from tests.helpers import make_config

TASKS = (
    "hopper",
    "walker2d",
    "halfcheetah",
    "ant",
    "ant_zero_contact",
    "ant_no_contact",
    "hopper_v5",
    "walker2d_v5",
    "halfcheetah_v5",
    "ant_v5",
    "inverted_double_pendulum",
    "humanoid",  # observes inertias, velocities and forces; its reward reads the bodies' centres of mass
)


def task(name: str, **changes: Any) -> EnvConfig:
    """A task of conf/env; a short time limit brings every kind of episode end into a short test."""
    return replace(make_config(env=name).env, **changes)


def random_policy(action_size: int, generator: torch.Generator, scale: float = 1.0) -> Any:
    """Uniform actions from a generator whose state the test can save, as a run does."""
    return lambda _: (torch.rand(action_size, generator=generator) * 2 - 1) * scale


def assert_same(left: Transitions, right: Transitions) -> None:
    """Bit for bit."""
    for name in Transitions._fields[:-1]:
        assert torch.equal(getattr(left, name), getattr(right, name)), name
    assert left.finished == right.finished
