"""A spiking layer: synapse, lateral interaction and neurons."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, TypeVar

import numpy as np
import torch
from torch import Tensor, nn

from src.actors.dn import DNConstants, DNState, dn_step
from src.actors.initialisation import Initialiser
from src.actors.lateral import LateralInteraction, OutputLateral
from src.actors.lif import LIFConstants, LIFState, lif_step
from src.actors.synapse import Synapse
from src.config.schema import DendriticConfig, LateralConfig

State = TypeVar("State", LIFState, DNState)


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
        self.synapse = Synapse(dendritic, inputs, neurons, initialiser.at("synapse"), partition_seed)
        self.lateral = LateralInteraction(lateral, neurons, initialiser.at("lateral")) if lateral.radius else None
        self.output_lateral = output_lateral

    def forward(self, spikes: Tensor) -> tuple[Tensor, Tensor]:
        """Spikes ``[T, B, inputs]`` to the spikes and membrane potentials (before the reset) ``[T, B, n]``."""
        x = self.synapse(spikes)
        feedback = None if self.output_lateral is None else self.output_lateral.feedback()
        lateral, offsets = (None, ()) if self.lateral is None else (self.lateral(), self.lateral.offsets)
        arguments: dict[str, Any] = {"lateral": lateral, "offsets": offsets, "constants": self.constants}
        if isinstance(self.constants, DNConstants):
            return unroll(x, DNState.rest(x[0]), partial(dn_step, **arguments), feedback)
        return unroll(x, LIFState.rest(x[0]), partial(lif_step, **arguments), feedback)


def unroll(
    x: Tensor, rest: State, step: Callable[[Tensor, State], State], feedback: Callable[[Tensor], Tensor] | None = None
) -> tuple[Tensor, Tensor]:
    """All T steps of a layer's neurons, the step before feeding the next.

    Args:
        x: input currents, ``[T, B, n]``.
        rest: the neurons' state before the first step.
        step: from ``x_tau`` and the state before it to the state after it.
        feedback: from the layer's own spikes of the step before to what they add to ``x_tau``, ``[B, n] -> [B, n]``.

    Returns:
        Spikes and membrane potentials (before the reset), ``[T, B, n]`` each.
    """
    state = rest
    spikes, potentials = [], []
    for x_tau in x:
        if feedback is not None:
            x_tau = x_tau + feedback(state.spikes)
        state = step(x_tau, state)
        spikes.append(state.spikes)
        potentials.append(state.potential)
    return torch.stack(spikes), torch.stack(potentials)
