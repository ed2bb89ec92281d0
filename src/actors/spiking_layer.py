"""A spiking layer: synapse, lateral interaction and LIF neurons."""

from __future__ import annotations

import numpy as np
from torch import Tensor, nn

from src.actors.initialisation import Initialiser
from src.actors.lateral import LateralInteraction
from src.actors.lif import LIFConstants
from src.actors.lif_op import lif
from src.actors.synapse import Encoded, Synapse
from src.config import DendriticConfig, LateralConfig


class SpikingLayer(nn.Module):
    """Spikes in, spikes out; all T steps at once, since a layer's input is known before it starts.

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

    def forward(
        self, spikes: Tensor, encoded: Encoded | None = None, membrane: bool = False
    ) -> tuple[Tensor, Tensor | None]:
        """Spikes ``[T, B, inputs] -> [T, B, n]``; with ``membrane`` also the membrane potentials.

        Args:
            spikes: of the layer before.
            encoded: of the first layer: what its input spikes encode.
            membrane: whether to give the membrane potentials ``[T, B, n]``, without gradient.
        """
        synapse = self.synapse
        lateral, offsets = (None, ()) if self.lateral is None else (self.lateral(), self.lateral.offsets)
        currents = synapse(spikes) if encoded is None else synapse.encoded(spikes, encoded)
        return lif(currents, synapse.neuron_bias, lateral, offsets, synapse.branches, self.constants, membrane)
