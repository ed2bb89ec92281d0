"""What a burst of updates reports, and its mean over an evaluation interval (the columns of ``training.csv``)."""

from __future__ import annotations

import math
from collections.abc import Sequence

import torch
from torch import Tensor

from src.actors.health import ActorHealth, LayerHealth

METRICS = ("critic_loss", "actor_loss", "q1", "q2", "log_probability", "actor_gradient_norm")


def health_columns(spiking_layers: int) -> list[str]:
    """Columns of ``training.csv`` for an actor with this many spiking layers; none for an actor without."""
    if spiking_layers == 0:
        return []
    names = (*LayerHealth._fields, "gradient_norm")
    return ["input_firing_rate", *(f"layer{k}_{name}" for k in range(1, spiking_layers + 1) for name in names)]


class Diverged(ArithmeticError):
    """A loss or a parameter is no longer finite; the message says which."""


class BurstRecord:
    """Collects tensors during one burst of updates; reading them is left to the end, so that no update waits."""

    def __init__(self) -> None:
        self._losses: dict[str, list[Tensor]] = {}
        self._values: list[Tensor] = []
        self._samples: list[tuple[Tensor, ...]] = []
        self.health: dict[str, float] = {}

    def add(self, name: str, value: Tensor) -> None:
        """Note a metric of one update, or of all of them, ``[C]``; its mean over the burst is reported."""
        self._losses.setdefault(name, []).append(value.detach())

    def add_values(self, values: Tensor) -> None:
        """Note the critics' values ``[2, B]``."""
        self._values.append(values.detach())

    def add_samples(self, *samples: Tensor) -> None:
        """Note what the actor's loss is made of, ``[..., B]`` each."""
        self._samples.append(samples)

    def samples(self) -> tuple[Tensor, ...]:
        """What was noted of all C updates, ``[..., C, B]`` each."""
        return tuple(torch.stack(parts, dim=-2) for parts in zip(*self._samples))

    def add_health(self, health: ActorHealth, gradients_per_layer: Sequence[Sequence[Tensor]]) -> None:
        """Note firing rates, window shares and gradient norms per spiking layer (spiking actors fail by saturation).

        Args:
            health: of one pass of the actor.
            gradients_per_layer: to the parameters of each spiking layer.
        """
        if health.input_firing_rate is not None:
            self.health["input_firing_rate"] = float(health.input_firing_rate)
        for k, (layer, gradients) in enumerate(zip(health.layers, gradients_per_layer), start=1):
            for name, value in layer._asdict().items():
                self.health[f"layer{k}_{name}"] = float(value)
            norms = [gradient.norm() for gradient in gradients]
            self.health[f"layer{k}_gradient_norm"] = float(torch.stack(norms).norm()) if norms else 0.0

    def means(self) -> dict[str, float]:
        """Mean of each noted tensor.

        Raises:
            Diverged: when one of them is not finite.
        """
        result = {name: float(torch.stack(values).mean()) for name, values in self._losses.items()}
        if self._values:
            result["q1"], result["q2"] = (float(q) for q in torch.stack(self._values).mean(dim=(0, 2)))
        for name, value in result.items():
            if not math.isfinite(value):
                raise Diverged(f"{name} is {value}")
        return result | self.health


class IntervalMeans:
    """Running means of burst reports over one evaluation interval; ``state_dict`` belongs to the checkpoint."""

    def __init__(self) -> None:
        self._sums: dict[str, float] = {}
        self._counts: dict[str, int] = {}

    def add(self, report: dict[str, float]) -> None:
        """Add one report."""
        for name, value in report.items():
            self._sums[name] = self._sums.get(name, 0.0) + value
            self._counts[name] = self._counts.get(name, 0) + 1

    def mean(self, name: str) -> float | None:
        """Mean of a column so far; None where nothing was reported."""
        return self._sums[name] / self._counts[name] if name in self._sums else None

    def state_dict(self) -> dict[str, dict[str, float]]:
        """Sums and counts."""
        return {"sums": dict(self._sums), "counts": {k: float(v) for k, v in self._counts.items()}}

    def load_state_dict(self, state: dict[str, dict[str, float]]) -> None:
        """Restore sums and counts."""
        self._sums = dict(state["sums"])
        self._counts = {k: int(v) for k, v in state["counts"].items()}
