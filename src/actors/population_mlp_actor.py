"""Pop-DAN: PopSAN's population code without its spikes, the control that tells the two apart [MDC-SAN's paper].

observation -> stimulation strength A -> ReLU layers -> output population (ReLU) -> population decoder -> raw action
"""

from __future__ import annotations

import torch
from torch import Tensor

from src.actors.actor import Actor
from src.actors.decoder import PopulationDecoder
from src.actors.initialisation import Initialiser
from src.actors.mlp import EnsembleMLP
from src.actors.population_encoder import PopulationEncoder
from src.config.schema import EncoderConfig, PopulationMLPActorConfig
from src.streams import Streams


class PopulationMLPActor(Actor):
    """A multilayer perceptron between PopSAN's encoder and decoder.

    Args:
        config: hidden sizes, output population.
        encoder: receptive fields; its strength is the input.
        observation_size: N.
        action_size: M.
        streams: the run's random streams; PyTorch's default Linear initialisation.
    """

    def __init__(
        self,
        config: PopulationMLPActorConfig,
        encoder: EncoderConfig,
        observation_size: int,
        action_size: int,
        streams: Streams,
    ) -> None:
        super().__init__()
        self.encoder = PopulationEncoder(encoder, observation_size, time_steps=1)
        sizes = (self.encoder.size, *config.hidden_sizes, action_size * config.output_population)
        self.hidden = EnsembleMLP(sizes, 1, streams, "actor.hidden", final_relu=True)
        self.decoder = PopulationDecoder(action_size, config.output_population, Initialiser(streams).at("decoder"))

    def forward(self, observation: Tensor, generator: torch.Generator | None = None) -> Tensor:
        """Raw action ``[B, M]``; draws nothing."""
        raw: Tensor = self.decoder(self.hidden(self.encoder.strength(observation)))
        return raw
