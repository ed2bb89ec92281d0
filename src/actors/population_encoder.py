"""Population encoder: Gaussian receptive fields over each observation dimension [P, Population coding].

    A_ij = exp(-(s_i - mu_ij)^2 / (2 sigma_ij^2)),   i = 1..N, j = 1..J       (input_map=tanh: of tanh(s_i))

mu = linspace(-3, 3, J) and sigma = sqrt(0.15), both learnable, a pair for each neuron [PopSAN].
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

from src.actors.spike_coding import Coding, encode
from src.config.schema import EncoderConfig

#: The largest exponent whose exponential is no normal float32 number (1.2e-38). Such strengths are 0, in every
#: precision: what they are wherever denormal numbers are flushed (:mod:`src.training.numerics`).
LOWEST_EXPONENT = -87.33655


class PopulationEncoder(nn.Module):
    """Receptive fields and the spike coding behind them.

    Args:
        config: the encoder's configuration; ``coding`` must not be ``"none"``.
        observation_size: N.
        time_steps: T.
    """

    mean: Tensor
    std: Tensor

    def __init__(self, config: EncoderConfig, observation_size: int, time_steps: int) -> None:
        super().__init__()
        if config.coding == "none":
            raise ValueError("A population encoder needs a coding: poisson, deterministic or analog.")
        self.coding: Coding = config.coding
        self.input_map = config.input_map
        self.time_steps = time_steps
        self.threshold = config.threshold
        self.min_std = config.min_std
        self.size = observation_size * config.population_size
        centres = torch.linspace(*config.mean_range, config.population_size)
        mean = centres.repeat(observation_size, 1)
        std = torch.full_like(mean, max(config.std, config.min_std))
        if config.learnable:
            self.mean, self.std = nn.Parameter(mean), nn.Parameter(std)
        else:
            self.register_buffer("mean", mean, persistent=False)
            self.register_buffer("std", std, persistent=False)

    def strength(self, observation: Tensor) -> Tensor:
        """Stimulation strength A in [0, 1], ``[B, N] -> [B, N*J]``.

        Raises:
            ValueError: observations of another size.
        """
        if observation.shape[1:] != self.mean.shape[:1]:
            raise ValueError(f"the encoder takes observations [B, {len(self.mean)}], not {[*observation.shape]}")
        if self.input_map == "tanh":
            observation = torch.tanh(observation)
        distance = observation.unsqueeze(-1) - self.mean  # [B, N, J]
        exponent = distance.square() * (-0.5 / self.std.square())
        return torch.exp(exponent).masked_fill(exponent <= LOWEST_EXPONENT, 0.0).flatten(1)

    def forward(self, observation: Tensor, generator: torch.Generator | None = None) -> Tensor:
        """Spike trains with straight-through gradient, ``[B, N] -> [T, B, N*J]``; Poisson coding takes a generator."""
        return encode(self.strength(observation), self.coding, self.time_steps, self.threshold, generator)

    @torch.no_grad()
    def project(self) -> None:
        """Keep sigma at or above its floor: at 0 the strength is NaN."""
        if isinstance(self.std, nn.Parameter):
            self.std.clamp_(min=self.min_std)
