"""A user's own actor with a bug that shows after a while."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn

from src.actors.actor import Actor


class RaisingActor(Actor):
    """Linear; raises in its 150th call where the file ``flag.<seed>`` exists."""

    def __init__(self, observation_size: int, action_size: int, streams: Any, encoder: None, flag: str) -> None:
        super().__init__()
        self.flag = Path(f"{flag}.{streams.seed}")
        self.calls = 0
        self.map = nn.Linear(observation_size, action_size)
        with torch.no_grad():
            for parameter in self.map.parameters():
                parameter.uniform_(-0.1, 0.1, generator=streams.torch("initialisation"))

    def forward(self, observation: Tensor, generator: torch.Generator | None = None) -> Tensor:
        self.calls += 1
        if self.calls == 150 and self.flag.exists():
            raise ZeroDivisionError("a bug in the user's actor")
        result: Tensor = self.map(observation)
        return result
