"""A spiking layer: synapse, lateral interaction and LIF neurons."""

from __future__ import annotations

import numpy as np
from torch import Tensor, nn

from src.actors.initialisation import Initialiser
from src.actors.lateral import LateralInteraction
from src.actors.lif import LIFConstants, lif_layer
from src.actors.synapse import Synapse
from src.config import DendriticConfig, LateralConfig


class SpikingLayer(nn.Module):
    """Spikes in, spikes out; the products of all T steps at once, since a layer's input is known before it starts.

    Args:
        dendritic: inter-layer connections.
        lateral: intra-layer connections; radius 0 is none.
        constants: of the LIF neurons.
        inputs: neurons of the layer before.
        neurons: n, of this layer.
        initialiser: of this module.
        partition_seed: seed sequence of the dendritic partition.
    """

    def __init__(
        self,
        dendritic: DendriticConfig,
        lateral: LateralConfig,
        constants: LIFConstants,
        inputs: int,
        neurons: int,
        initialiser: Initialiser,
        partition_seed: np.random.SeedSequence,
    ) -> None:
        super().__init__()
        self.constants = constants
        self.synapse = Synapse(dendritic, inputs, neurons, initialiser.at("synapse"), partition_seed)
        self.lateral = LateralInteraction(lateral, neurons, initialiser.at("lateral")) if lateral.radius else None

    def forward(self, spikes: Tensor) -> tuple[Tensor, Tensor]:
        """Spikes ``[T, B, inputs]`` to the spikes and membrane potentials (before the reset) ``[T, B, n]``."""
        x = self.synapse(spikes)
        if self.lateral is None:
            return lif_layer(x, None, (), self.constants)
        return lif_layer(x, self.lateral(), self.lateral.offsets, self.constants)
