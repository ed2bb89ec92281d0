"""A spiking layer: synapse, lateral interaction and neurons."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from torch import Tensor, nn

from src.actors.dn import DNConstants, dn_layer
from src.actors.initialisation import Initialiser
from src.actors.lateral import LateralInteraction
from src.actors.lif import LIFConstants, lif_layer
from src.actors.output_lateral import OutputLateral
from src.actors.synapse import Synapse
from src.config import DendriticConfig, LateralConfig


class SpikingLayer(nn.Module):
    """Spikes in, spikes out; the products of all T steps at once, since a layer's input is known before it starts.

    Args:
        dendritic: inter-layer connections.
        lateral: intra-layer connections; radius 0 is none.
        constants: of the neurons; their type says which they are.
        inputs: neurons of the layer before.
        neurons: n, of this layer.
        initialiser: of this module.
        partition_seed: seed sequence of the dendritic partition.
        output_lateral: of an output population whose neurons reach each other's current.
    """

    def __init__(
        self,
        dendritic: DendriticConfig,
        lateral: LateralConfig,
        constants: LIFConstants | DNConstants,
        inputs: int,
        neurons: int,
        initialiser: Initialiser,
        partition_seed: np.random.SeedSequence,
        output_lateral: OutputLateral | None = None,
    ) -> None:
        super().__init__()
        self.constants = constants
        self.neurons: Callable[..., Any] = dn_layer if isinstance(constants, DNConstants) else lif_layer
        self.synapse = Synapse(dendritic, inputs, neurons, initialiser.at("synapse"), partition_seed)
        self.lateral = LateralInteraction(lateral, neurons, initialiser.at("lateral")) if lateral.radius else None
        self.output_lateral = output_lateral

    def forward(self, spikes: Tensor) -> tuple[Tensor, Tensor]:
        """Spikes ``[T, B, inputs]`` to the spikes and membrane potentials (before the reset) ``[T, B, n]``."""
        x = self.synapse(spikes)
        feedback = None if self.output_lateral is None else self.output_lateral.feedback()
        lateral, offsets = (None, ()) if self.lateral is None else (self.lateral(), self.lateral.offsets)
        spikes_and_potentials: tuple[Tensor, Tensor] = self.neurons(x, lateral, offsets, self.constants, feedback)
        return spikes_and_potentials
