"""The same spiking actor, written the way a first draft would be: one product per layer, branch and step, by autograd.

It has the parameters and random streams of :class:`SpikingActor` and shares none of its arithmetic: the tests hold the
actor against it, ``benchmarks/reference.py`` times it.
"""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn import functional as F

from src.actors.health import Activity
from src.actors.lateral import LateralInteraction
from src.actors.lif import LIFConstants
from src.actors.philox import draw_key, uniform
from src.actors.population_encoder import LOWEST_EXPONENT, PopulationEncoder
from src.actors.spiking_actor import SpikingActor
from src.actors.spiking_layer import SpikingLayer


class StepwiseSpikingActor(SpikingActor):
    """:class:`SpikingActor`, computed step by step."""

    def activity(self, observation: Tensor, generator: torch.Generator | None = None) -> Activity:
        """See :meth:`SpikingActor.activity`."""
        spikes = encoder_steps(self.encoder, observation, generator)
        input_spikes = torch.stack(spikes)
        layers = []
        for layer in self.spiking_layers():
            spikes, potentials = layer_steps(layer, spikes)
            layers.append((torch.stack(spikes), torch.stack(potentials)))
        return Activity(input_spikes, layers)


def with_gradient_of(value: Tensor, source: Tensor) -> Tensor:
    """``value``, with the gradient of ``source``."""
    return value.detach() + (source - source.detach())


def encoder_steps(encoder: PopulationEncoder, observation: Tensor, generator: torch.Generator | None) -> list[Tensor]:
    """Spikes of each step, ``[B, N*J]``."""
    exponent = (observation.unsqueeze(-1) - encoder.mean) ** 2 * (-0.5 / encoder.std**2)
    strength = torch.where(exponent > LOWEST_EXPONENT, torch.exp(exponent), 0.0).flatten(1)
    if encoder.coding == "poisson":
        if generator is None:
            raise ValueError("Poisson coding needs a generator")
        draws = uniform(draw_key(generator), encoder.time_steps, strength.numel(), strength.device)
        steps = draws.view(encoder.time_steps, *strength.shape)
        return [with_gradient_of((draw < strength).to(strength.dtype), strength) for draw in steps]
    voltage = torch.zeros_like(strength)
    spikes = []
    for _ in range(encoder.time_steps):
        voltage = voltage + strength
        spikes.append(with_gradient_of((voltage > encoder.threshold).to(strength.dtype), voltage))
        voltage = voltage - encoder.threshold * spikes[-1]
    return spikes


def layer_steps(layer: SpikingLayer, inputs: list[Tensor]) -> tuple[list[Tensor], list[Tensor]]:
    """Spikes and membrane potentials of each step, ``[B, n]``."""
    constants = layer.constants
    assert isinstance(constants, LIFConstants)
    current = potential = spikes = inputs[0].new_zeros(inputs[0].shape[0], layer.synapse.weight.shape[0])
    all_spikes, potentials = [], []
    for spikes_in in inputs:
        before = spikes
        current = constants.current_decay * current + input_current(layer, spikes_in)
        kept = 1 - (before if constants.reset_gradient else before.detach())
        potential = constants.voltage_decay * potential * kept + current
        if layer.lateral is not None:
            heard = before if constants.lateral_gradient else before.detach()
            for term in lateral_currents(layer.lateral, heard):
                potential = potential + term
        inside = (potential - constants.threshold).abs() < constants.window
        fired = (potential > constants.threshold).to(potential.dtype)
        spikes = with_gradient_of(fired, torch.where(inside, potential, 0.0))
        all_spikes.append(spikes)
        potentials.append(potential)
    return all_spikes, potentials


def input_current(layer: SpikingLayer, spikes: Tensor) -> Tensor:
    """``Inter`` of one step, ``[B, n]``: the largest branch, of equal ones the first."""
    synapse = layer.synapse
    largest: Tensor | None = None
    for branch in range(synapse.branches):
        weight = synapse.weight if synapse.branch is None else synapse.weight * (synapse.branch == branch)
        current = F.linear(spikes, weight, synapse.bias[branch] if synapse.bias_per_branch else None)
        largest = current if largest is None else torch.where(current > largest, current, largest)
    assert largest is not None
    return largest if synapse.bias_per_branch else largest + synapse.bias


def lateral_currents(lateral: LateralInteraction, spikes: Tensor) -> list[Tensor]:
    """The terms of ``Intra`` of one step, ``[B, n]`` each: what every neuron hears from one neighbour."""
    neurons = spikes.shape[1]
    terms = []
    for weight, offset in zip(lateral(), lateral.offsets, strict=True):
        low = max(0, -offset)
        high = max(low, min(neurons, neurons - offset))
        heard = weight[low:high] * spikes[:, low + offset : high + offset]
        terms.append(F.pad(heard, (low, neurons - high)) if low < high else torch.zeros_like(spikes))
    return terms
