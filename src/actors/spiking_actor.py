"""The spiking actor network: PopSAN, BPT-SAN and its ablations, MDC-SAN and ILC-SAN, told apart by configuration.

    observation -> population encoder -> spiking layers -> population decoder -> raw action

Without dendrites (``branches=1``) and lateral interaction (``radius=0``) BPT-SAN is PopSAN, bit for bit.
"""

from __future__ import annotations

from dataclasses import asdict, replace
from itertools import pairwise
from typing import cast

import torch
from torch import Tensor, nn

from src.actors.actor import Actor
from src.actors.decoder import MembraneReadout, PopulationDecoder
from src.actors.dn import DNConstants
from src.actors.health import Activity, ActorHealth, layer_health
from src.actors.initialisation import Initialiser
from src.actors.lateral import OutputLateral
from src.actors.lif import LIFConstants
from src.actors.population_encoder import PopulationEncoder
from src.actors.spiking_layer import SpikingLayer
from src.config.schema import EncoderConfig, SpikingActorConfig
from src.streams import Streams


class SpikingActor(Actor):
    """A population-coded spiking actor.

    Args:
        config: layers, neurons, dendrites, lateral interaction.
        encoder: receptive fields and spike coding.
        observation_size: N.
        action_size: M.
        streams: the run's random streams; initialisation and, without ``mask_seed``, the dendritic partition.

    Raises:
        ConfigurationError: more branches than a layer has inputs.
    """

    def __init__(
        self,
        config: SpikingActorConfig,
        encoder: EncoderConfig,
        observation_size: int,
        action_size: int,
        streams: Streams,
    ) -> None:
        super().__init__()
        initialiser = Initialiser(streams)
        masks = streams if config.mask_seed is None else Streams(config.mask_seed)
        constants = neuron_constants(config)
        population = (action_size, config.output_population)
        self.encoder = PopulationEncoder(encoder, observation_size, config.time_steps)
        sizes = (self.encoder.size, *config.hidden_sizes, action_size * config.output_population)
        self.layers = nn.ModuleList()
        for index, (inputs, neurons) in enumerate(pairwise(sizes)):
            is_output = index == len(config.hidden_sizes)
            is_linear = is_output and not config.dendritic.output_topology
            of_layer = initialiser.at(f"layers.{index}")
            layer = SpikingLayer(
                replace(config.dendritic, branches=1) if is_linear else config.dendritic,
                replace(config.lateral, radius=0) if is_linear else config.lateral,
                constants,
                inputs,
                neurons,
                of_layer,
                masks.sequence("dendrite mask", index),
                _output_lateral(config, action_size, of_layer.at("output_lateral")) if is_output else None,
            )
            self.layers.append(layer)
        decoder = initialiser.at("decoder")
        if config.readout == "rate":
            self.decoder = PopulationDecoder(*population, decoder)
        else:
            self.decoder = MembraneReadout(config.readout, config.readout_decay, *population, decoder)

    def activity(self, observation: Tensor, generator: torch.Generator | None = None) -> Activity:
        """Spikes and membrane potentials of every layer for observations ``[B, N]``.

        Raises:
            ValueError: Poisson coding without a generator.
        """
        return self.propagate(self.encoder(observation, generator))

    def propagate(self, input_spikes: Tensor) -> Activity:
        """The same from the encoder's spikes on, ``[T, B, N*J]``."""
        spikes = input_spikes
        layers = []
        for layer in self.spiking_layers():
            spikes, potentials = layer(spikes)
            layers.append((spikes, potentials))
        return Activity(input_spikes, layers)

    def forward(self, observation: Tensor, generator: torch.Generator | None = None) -> Tensor:
        """Raw action ``[B, M]``; raises ValueError when Poisson coding has no generator."""
        raw: Tensor = self.decoder(self.activity(observation, generator).output_spikes)
        return raw

    def forward_with_health(
        self, observation: Tensor, generator: torch.Generator | None = None
    ) -> tuple[Tensor, ActorHealth]:
        """:meth:`forward`, and the firing rates and saturation of every layer in the same pass.

        A subclass with a ``forward`` of its own has no health, unless it measures it.
        """
        if type(self).forward is not SpikingActor.forward:
            return super().forward_with_health(observation, generator)
        seen = self.activity(observation, generator)
        health = [
            layer_health(spikes, potentials, layer.constants.threshold, layer.constants.window)
            for (spikes, potentials), layer in zip(seen.layers, self.spiking_layers(), strict=True)
        ]
        return self.decoder(seen.output_spikes), ActorHealth(seen.input_spikes.detach().mean(), tuple(health))

    def spiking_layers(self) -> list[SpikingLayer]:
        """The layers in the order of the data, the output population last."""
        return [cast(SpikingLayer, layer) for layer in self.layers]

    def layer_parameters(self) -> list[list[nn.Parameter]]:
        """Weight, bias and lateral weights of each spiking layer, the output population last."""
        return [list(layer.parameters()) for layer in self.layers]


def neuron_constants(config: SpikingActorConfig) -> LIFConstants | DNConstants:
    """Constants of the configured neuron model."""
    if config.neuron == "dn":
        return DNConstants(
            config.current_decay,
            config.threshold,
            config.surrogate_window,
            config.reset_gradient,
            config.lateral_gradient,
            **asdict(config.dn),
        )
    return LIFConstants(
        config.current_decay,
        config.voltage_decay,
        config.threshold,
        config.surrogate_window,
        config.reset_gradient,
        config.lateral_gradient,
    )


def _output_lateral(config: SpikingActorConfig, action_size: int, initialiser: Initialiser) -> OutputLateral | None:
    """Connections within the output population, where there are any."""
    if config.output_lateral == "none":
        return None
    return OutputLateral(
        config.output_lateral,
        config.output_lateral_bias,
        config.lateral_gradient,
        action_size,
        config.output_population,
        initialiser,
    )
