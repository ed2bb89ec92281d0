"""The same spiking actor written plainly: one product per layer and step, eager autograd throughout.

It shares parameters and random streams with :class:`SpikingActor`, and is what the fused one is tested and timed
against.
"""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn import functional as F

from src.actors.health import Trace
from src.actors.lif import lif_step, maxout
from src.actors.population_encoder import PopulationEncoder
from src.actors.spike_coding import poisson_draws
from src.actors.spiking_actor import SpikingActor
from src.actors.spiking_layer import SpikingLayer


class StraightThroughStep(torch.autograd.Function):
    """``1 if a > b else 0`` with gradient 1 to a."""

    @staticmethod
    def forward(ctx: object, a: Tensor, b: Tensor | float) -> Tensor:
        """Spikes of the shape of a."""
        return (a > b).to(a.dtype)

    @staticmethod
    def backward(ctx: object, *grads: Tensor) -> tuple[Tensor, None]:
        """Straight through."""
        return grads[0], None


class StepwiseSpikingActor(SpikingActor):
    """:class:`SpikingActor`, computed step by step."""

    def _pass(self, observation: Tensor, generator: torch.Generator | None, trace: bool) -> tuple[Tensor, Trace]:
        spikes = encoder_steps(self.encoder, observation, generator)
        seen = Trace(torch.stack(spikes).detach(), [])
        for layer in self.spiking_layers():
            spikes, potentials = layer_steps(layer, spikes)
            if trace:
                seen.layers.append((torch.stack(spikes), torch.stack(potentials)))
        return self.decoder(torch.stack(spikes)), seen


def encoder_steps(encoder: PopulationEncoder, observation: Tensor, generator: torch.Generator | None) -> list[Tensor]:
    """Spikes of each step, ``[B, N*J]``."""
    distance = observation.unsqueeze(-1) - encoder.mean
    strength = torch.exp(distance.square() * (-0.5 / encoder.std.square())).flatten(1)
    step = StraightThroughStep.apply
    if encoder.coding == "poisson":
        draws = poisson_draws(strength, encoder.time_steps, generator)
        return [step(strength, draw) for draw in draws]  # type: ignore[no-untyped-call]
    voltage = torch.zeros_like(strength)
    spikes = []
    for _ in range(encoder.time_steps):
        voltage = voltage + strength
        spikes.append(step(voltage, encoder.threshold))  # type: ignore[no-untyped-call]
        voltage = voltage - encoder.threshold * spikes[-1]
    return spikes


def layer_steps(layer: SpikingLayer, inputs: list[Tensor]) -> tuple[list[Tensor], list[Tensor]]:
    """Spikes and membrane potentials of each step, ``[B, n]``."""
    synapse, lateral = layer.synapse, layer.lateral
    if synapse.branch is None:
        weights: list[Tensor] = [synapse.weight]
    else:
        weights = [synapse.weight * (synapse.branch == index) for index in range(synapse.branches)]
    spikes, potentials = [], []
    zeros = inputs[0].new_zeros(inputs[0].shape[0], synapse.weight.shape[0])
    state = (zeros, zeros, zeros)
    for spikes_in in inputs:
        branches = [F.linear(spikes_in, weight) for weight in weights]
        if synapse.bias_per_branch:
            branches = [current + bias for current, bias in zip(branches, synapse.bias, strict=True)]
        x = maxout(torch.stack(branches, dim=1))[0]
        if not synapse.bias_per_branch:
            x = x + synapse.bias
        weight, offsets = (None, ()) if lateral is None else (lateral(), lateral.offsets)
        state = lif_step(x, state, weight, offsets, layer.constants)
        spikes.append(state[2])
        potentials.append(state[1])
    return spikes, potentials
