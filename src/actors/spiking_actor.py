"""The spiking actor network: PopSAN, BPT-SAN and its ablations are one class, told apart by configuration.

    observation -> population encoder -> spiking layers -> population decoder -> raw action

Without dendrites (``branches=1``) and lateral interaction (``radius=0``) BPT-SAN is PopSAN, bit for bit.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from itertools import pairwise
from typing import cast

import torch
from torch import Tensor, nn

from src.actors.actor import Actor, Pull
from src.actors.actor_op import fused_actor, fused_gradient
from src.actors.decoder import PopulationDecoder
from src.actors.health import ActorHealth, Trace, layer_health
from src.actors.initialisation import Initialiser
from src.actors.lif import LIFConstants
from src.actors.population_encoder import PopulationEncoder
from src.actors.spiking_layer import SpikingLayer
from src.actors.spiking_network import Network, Weights
from src.actors.synapse import Encoded
from src.config import EncoderConfig, SpikingActorConfig
from src.places import Places, fixed_places
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
        constants = LIFConstants(
            config.current_decay,
            config.voltage_decay,
            config.threshold,
            config.surrogate_window,
            config.reset_gradient,
            config.lateral_gradient,
        )
        self.encoder = PopulationEncoder(encoder, observation_size, config.time_steps)
        sizes = (self.encoder.size, *config.hidden_sizes, action_size * config.output_population)
        self.layers = nn.ModuleList()
        for index, (inputs, neurons) in enumerate(pairwise(sizes)):
            plain = index == len(config.hidden_sizes) and not config.dendritic.output_topology
            layer = SpikingLayer(
                replace(config.dendritic, branches=1) if plain else config.dendritic,
                replace(config.lateral, radius=0) if plain else config.lateral,
                constants,
                inputs,
                neurons,
                initialiser.at("layers").at(index),
                masks.sequence("dendrite mask", index),
            )
            self.layers.append(layer)
        self.decoder = PopulationDecoder(action_size, config.output_population, initialiser.at("decoder"))
        self._network = Network(self.encoder, self.spiking_layers(), self.decoder)

    @property
    def places(self) -> Places:
        """What is known of where its parameters lie."""
        return self._network.places

    def forward(self, observation: Tensor, generator: torch.Generator | None = None) -> Tensor:
        """Raw action ``[B, M]``; raises ValueError when Poisson coding has no generator."""
        return self._pass(observation, generator, trace=False)[0]

    def forward_with_health(
        self, observation: Tensor, generator: torch.Generator | None = None
    ) -> tuple[Tensor, ActorHealth]:
        """:meth:`forward`, and the firing rates and saturation of every layer in the same pass.

        A subclass with a ``forward`` of its own has no health, unless it measures it.
        """
        if type(self).forward is not SpikingActor.forward:
            return super().forward_with_health(observation, generator)
        raw, trace = self._pass(observation, generator, trace=True)
        return raw, self._health(trace)

    def minibatches(self, observation: Tensor, generator: torch.Generator | None = None) -> Tensor:
        """See :meth:`Actor.minibatches`; one pass where there are kernels."""
        weights = self._network.weights(observation, for_gradient=False)
        if type(self) is not SpikingActor or weights is None:
            return super().minibatches(observation, generator)
        return fused_actor(self._network, weights, observation, generator, keep=False).raw

    def vjp(
        self, observation: Tensor, generator: torch.Generator | None = None, with_health: bool = False
    ) -> tuple[Tensor, ActorHealth | None, Pull]:
        """See :meth:`Actor.vjp`; without autograd where there are kernels."""
        weights = self._network.weights(observation, for_gradient=True)
        if type(self) is not SpikingActor or weights is None:  # a subclass may compute something else
            return super().vjp(observation, generator, with_health)
        (raw,), health, pull = self._fused_vjp(weights, observation.unsqueeze(0), generator, with_health)
        return raw, health, pull

    def vjp_after(
        self, before: Tensor, observation: Tensor, generator: torch.Generator | None = None, with_health: bool = False
    ) -> tuple[Tensor, Tensor, ActorHealth | None, Pull]:
        """See :meth:`Actor.vjp_after`; one pass where there are kernels."""
        weights = self._network.weights(observation, for_gradient=True)
        if type(self) is not SpikingActor or weights is None or before.shape != observation.shape:
            return super().vjp_after(before, observation, generator, with_health)
        both = torch.stack([before, observation])
        (raw_before, raw), health, pull = self._fused_vjp(weights, both, generator, with_health)
        return raw_before, raw, health, pull

    def _fused_vjp(
        self, weights: Weights, observation: Tensor, generator: torch.Generator | None, with_health: bool
    ) -> tuple[Tensor, ActorHealth | None, Pull]:
        """Raw actions ``[G, B, M]`` of G minibatches; health and gradient of the last."""
        done = fused_actor(self._network, weights, observation, generator, keep=True)
        health = self._health(done.trace()) if with_health else None
        return done.raw, health, partial(fused_gradient, self._network, done)

    @torch.no_grad()
    def _health(self, trace: Trace) -> ActorHealth:
        health = [
            layer_health(*what, layer.constants.threshold, layer.constants.window)
            for what, layer in zip(trace.layers, self.spiking_layers(), strict=True)
        ]
        return ActorHealth(trace.input_spikes.mean(), tuple(health))

    def _pass(self, observation: Tensor, generator: torch.Generator | None, trace: bool) -> tuple[Tensor, Trace]:
        weights = None if torch.is_grad_enabled() else self._network.weights(observation, for_gradient=False)
        if weights is not None:
            done = fused_actor(self._network, weights, observation.unsqueeze(0), generator, keep=trace)
            return done.raw[0], done.trace() if trace else Trace(done.input_spikes[0], [])
        strength = self.encoder.strength(observation)
        spikes = self.encoder.encode(strength, generator)
        seen = Trace(spikes, [])
        encoded: Encoded | None = Encoded(strength, self.encoder.coding_gradient())
        for layer in self.spiking_layers():
            spikes, potentials = layer(spikes, encoded, membrane=trace)
            encoded = None
            if trace:
                seen.layers.append((spikes, potentials))
        return self.decoder(spikes), seen

    def spiking_layers(self) -> list[SpikingLayer]:
        """The layers in the order of the data, the output population last."""
        return [cast(SpikingLayer, layer) for layer in self.layers]

    def layer_parameters(self) -> list[list[nn.Parameter]]:
        """Weight, bias and lateral weights of each spiking layer, the output population last."""
        return [list(layer.parameters()) for layer in self.layers]

    def project(self) -> None:
        """Keep the encoder's sigma at or above its floor."""
        self.encoder.project()

    @contextmanager
    def fixed_weights(self) -> Iterator[None]:
        """Within, the branch weights of the dendrites are expanded once."""
        for layer in self.spiking_layers():
            layer.synapse.fix()
        try:
            with fixed_places(self):
                yield
        finally:
            for layer in self.spiking_layers():
                layer.synapse.release()
