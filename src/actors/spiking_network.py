"""The parts of a spiking actor, and their weights as the kernels of :mod:`src.actors.actor_op` take them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor, nn

from src.actors.decoder import PopulationDecoder
from src.actors.kernels import takes_kernel
from src.actors.population_encoder import PopulationEncoder
from src.actors.spiking_layer import SpikingLayer
from src.places import Places


class Network:
    """The parts of a spiking actor, at hand, since a module takes its time to find one. Who replaces a module makes a
    network of the new ones. Parameters are looked up at each pass, and once within
    :func:`src.places.fixed_places`.
    """

    def __init__(self, encoder: PopulationEncoder, layers: Sequence[SpikingLayer], decoder: PopulationDecoder) -> None:
        self.encoder, self.decoder = encoder, decoder
        self.layers = [(layer.synapse, layer.lateral) for layer in layers]
        self.offsets = next((layer.lateral.offsets for layer in layers if layer.lateral is not None), ())
        self.constants = layers[0].constants
        self.places = Places()

    def weights(self, observation: Tensor, for_gradient: bool) -> Weights | None:
        """The layers' weights, or None where the kernels do not serve.

        They take float32 on the CPU and, for a gradient, parameters that are not made of others and serve in one place
        only.
        """
        if not takes_kernel(observation):
            return None
        return self.places.once(Network._look_up, self, for_gradient)

    @torch.no_grad()
    def _look_up(self, for_gradient: bool) -> Weights | None:
        encoder, decoder = self.encoder, self.decoder
        learning: list[Tensor] = [decoder.weight, decoder.bias]
        for synapse, lateral in self.layers:
            learning += [synapse.weight, synapse.bias]
            if lateral is not None:
                learning.append(lateral.weight)
        if not all(takes_kernel(x) for x in (encoder.mean, encoder.std, *learning)) or (
            for_gradient and not self._are_parameters(learning)
        ):
            return None
        layers, copied = [], False
        for synapse, lateral in self.layers:
            weight, bias = synapse.weight.detach().contiguous(), synapse.bias.detach().contiguous()
            matrix, branch = (weight, None) if synapse.branches == 1 else synapse.spreading(for_gradient)
            across = None if lateral is None else lateral().detach().contiguous()
            layers.append(Layer(weight, bias, across, branch, matrix, synapse.branches, synapse.bias_per_branch))
            copied |= weight.data_ptr() != synapse.weight.data_ptr() or bias.data_ptr() != synapse.bias.data_ptr()
            copied |= across is not None and lateral is not None and across.data_ptr() != lateral.weight.data_ptr()
        shapes = tuple(
            (x.weight.shape, x.bias.shape, None if x.lateral is None else x.lateral.shape, x.branches) for x in layers
        )
        return Weights(layers, shapes, np.array([layer.row() for layer in layers], np.int64), copied)

    def _are_parameters(self, learning: Sequence[Tensor]) -> bool:
        """Each one of its own; the encoder's may also be fixed."""
        own = {id(x) for x in learning if isinstance(x, nn.Parameter)}
        encoder = {id(x) for x in (*self.encoder.parameters(), *self.encoder.buffers())}
        return len(own) == len(learning) and {id(self.encoder.mean), id(self.encoder.std)} <= encoder


class Layer(NamedTuple):
    """What the kernels take of a layer; contiguous."""

    weight: Tensor  # [n, inputs]
    bias: Tensor  # [n], or [d, n] of the branches
    lateral: Tensor | None  # [K, n]
    branch: Tensor | None  # of each synapse, [n, inputs], int8, where the weight is to be spread over them
    matrix: Tensor | None  # the branch weights [d*n, inputs], where they are at hand; for d = 1 the weight
    branches: int  # d
    by_branch: bool  # the bias is of the branches

    def row(self) -> tuple[int, ...]:
        """Addresses, 0 for none, and numbers, as the kernels take them."""
        weight, bias, lateral, branch, matrix = (0 if part is None else part.data_ptr() for part in self[:5])
        neighbours = 0 if self.lateral is None else len(self.lateral)
        return weight, bias, lateral, neighbours, branch, matrix, self.branches, self.by_branch


class Weights(NamedTuple):
    """Of all layers."""

    layers: list[Layer]  # read by nobody: they keep alive what the table has the addresses of
    shapes: tuple[tuple[torch.Size, torch.Size, torch.Size | None, int], ...]  # weight, bias, lateral weights; d
    table: np.ndarray  # as the kernels take it
    copied: bool  # some are copies, since a parameter is not contiguous, made of another, or shared by the neurons
