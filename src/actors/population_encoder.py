"""Population encoder: Gaussian receptive fields over each observation dimension [P, Population coding].

    A_ij = exp(-(s_i - mu_ij)^2 / (2 sigma_ij^2)),   i = 1..N, j = 1..J

mu = linspace(-3, 3, J) and sigma = sqrt(0.15), both learnable, a pair for each neuron [PopSAN].
"""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor, nn

from src.actors.coding_kernel import LOWEST, exponent_kernel, underflow_kernel
from src.actors.kernels import takes_kernel
from src.actors.spike_coding import Coding, StraightThroughSpikes, coding_gradient, encode
from src.config import EncoderConfig


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
            raise ValueError("A population encoder needs a spike coding: poisson or deterministic.")
        self.coding: Coding = config.coding
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
        """Stimulation strength A in (0, 1], ``[B, N] -> [B, N*J]``."""
        return GaussianReceptiveFields.apply(observation, self.mean, self.std).flatten(1)  # type: ignore[no-untyped-call]

    def encode(self, strength: Tensor, generator: torch.Generator | None, out: Tensor | None = None) -> Tensor:
        """Spike trains without gradient, ``[B, N*J] -> [T, B, N*J]``; see :func:`spike_coding.encode`."""
        return encode(strength, self.coding, self.time_steps, self.threshold, generator, out)

    def coding_gradient(self) -> list[float]:
        """``d spike_tau / d A`` for tau = 1..T."""
        return coding_gradient(self.coding, self.time_steps, self.threshold)

    def forward(self, observation: Tensor, generator: torch.Generator | None = None) -> Tensor:
        """Spike trains with straight-through gradient, ``[B, N] -> [T, B, N*J]``."""
        strength = self.strength(observation)
        return StraightThroughSpikes.apply(strength, self.coding, self.time_steps, self.threshold, generator)  # type: ignore[no-untyped-call]

    @torch.no_grad()
    def project(self) -> None:
        """Keep sigma at or above its floor: at 0 the strength is NaN."""
        if isinstance(self.std, nn.Parameter):
            self.std.clamp_(min=self.min_std)


class GaussianReceptiveFields(torch.autograd.Function):
    """:func:`receptive_fields`; its gradient by hand (autograd keeps six copies)."""

    @staticmethod
    def forward(ctx: Any, observation: Tensor, mean: Tensor, std: Tensor) -> Tensor:
        """``exp(-(s - mu)^2 / (2 sigma^2))``."""
        distance, strength = receptive_fields(observation, mean, std)
        ctx.save_for_backward(distance, strength, std)
        return strength

    @staticmethod
    def backward(ctx: Any, *grads: Tensor) -> tuple[Tensor | None, Tensor, Tensor]:
        """Gradients to observation, mean and std."""
        distance, strength, std = ctx.saved_tensors
        return receptive_field_gradients(grads[0], distance, strength, std, ctx.needs_input_grad[0])


def receptive_fields(observation: Tensor, mean: Tensor, std: Tensor) -> tuple[Tensor, Tensor]:
    """``s - mu`` and the strength ``exp(-(s - mu)^2 / (2 sigma^2))``, ``[B, N, J]``, of an observation ``[B, N]``.

    Strengths below float32's smallest normal number, 1.2e-38, are 0: what they are wherever denormal numbers are
    flushed (:mod:`src.training.numerics`).
    """
    if not all(takes_kernel(x) for x in (observation, mean, std)):
        distance = observation.unsqueeze(-1) - mean
        exponent = distance.square().mul_(-0.5 / std.square())
        return distance, exponent.exp().masked_fill_(exponent <= float(LOWEST), 0.0)
    if observation.shape[1:] != mean.shape[:1] or std.shape != mean.shape:
        found = f"{[*observation.shape]} and sigma {[*std.shape]}"
        raise ValueError(f"an encoder of {[*mean.shape]} takes observations [B, {mean.shape[0]}], not {found}")
    shape, parts = (*observation.shape, mean.shape[1]), (observation.contiguous(), mean.contiguous(), std.contiguous())
    distance, exponent = observation.new_empty(shape), observation.new_empty(shape)
    exponent_kernel()(*shape, *(x.data_ptr() for x in (*parts, distance, exponent)))
    strength = exponent.exp_()
    underflow_kernel()(strength.numel(), strength.data_ptr())
    return distance, strength


def receptive_field_gradients(
    grad: Tensor, distance: Tensor, strength: Tensor, std: Tensor, to_observation: bool
) -> tuple[Tensor | None, Tensor, Tensor]:
    """``dA/dmu = A (s - mu) / sigma^2``, ``dA/dsigma = A (s - mu)^2 / sigma^3``, ``dA/ds = -dA/dmu``.

    From the gradient to the strength ``[B, N, J]`` to those of the observation ``[B, N]`` (or None), mean and std.
    """
    slope = grad * strength * distance
    variance = std.square()
    grad_mean = slope.sum(0) / variance
    grad_std = (slope * distance).sum(0) / (variance * std)
    grad_observation = -(slope / variance).sum(-1) if to_observation else None
    return grad_observation, grad_mean, grad_std
