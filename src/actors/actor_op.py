"""A whole spiking actor as one node of autograd's graph, its layers as one call of a compiled kernel in each direction.

Products this small leave Python and PyTorch as much to do around them as in them. Values and gradients are those of
encoder, layers and decoder one after the other, bit for bit; those serve wherever this does not.

What the layers did lies in one block of memory, the gradients of their parameters in another.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor
from torch.autograd.function import once_differentiable

from src.actors.decoder import PopulationDecoder, decode
from src.actors.health import Trace
from src.actors.kernels import as_array, takes_kernel
from src.actors.lif_cpu import offsets_array
from src.actors.lif_kernel import network_backward_kernel, network_forward_kernel
from src.actors.population_encoder import PopulationEncoder, receptive_field_gradients, receptive_fields
from src.actors.spiking_layer import SpikingLayer

_FLOAT = 4  # bytes
_LINE = 16  # floats of a cache line, at which each part of what the layers did begins


class Network:
    """The parts of a spiking actor, at hand, since a module takes its time to find one. Who replaces a module makes a
    network of the new ones; parameters are looked up at each pass.
    """

    def __init__(self, encoder: PopulationEncoder, layers: Sequence[SpikingLayer], decoder: PopulationDecoder) -> None:
        self.encoder, self.decoder = encoder, decoder
        self.layers = [(layer.synapse, layer.lateral) for layer in layers]
        self.offsets = next((layer.lateral.offsets for layer in layers if layer.lateral is not None), ())
        self.constants = layers[0].constants
        self.bias_per_neuron = not any(layer.synapse.bias_per_branch for layer in layers)

    def takes(self, observation: Tensor) -> bool:
        """Whether :func:`fused_actor` serves: float32 on the CPU, a bias for each neuron."""
        tensors = (observation, self.encoder.mean, self.decoder.weight, *(synapse.weight for synapse, _ in self.layers))
        return self.bias_per_neuron and all(takes_kernel(tensor) for tensor in tensors)


def fused_actor(
    network: Network, observation: Tensor, generator: torch.Generator | None, trace: bool = False
) -> tuple[Tensor, Trace]:
    """A pass of the actor.

    Args:
        network: the actor.
        observation: ``[B, N]``.
        generator: the stream of Poisson coding.
        trace: whether the trace has the layers.

    Returns:
        The raw action ``[B, M]``, with gradient, and the trace, without.

    Raises:
        ValueError: an observation of another size; Poisson coding without a generator.
    """
    encoder, decoder = network.encoder, network.decoder
    parameters: list[Tensor | None] = [encoder.mean, encoder.std, decoder.weight, decoder.bias]
    connections: list[_Connection] = []
    for synapse, lateral in network.layers:
        parameters += [
            synapse.weight.contiguous(),
            synapse.bias.contiguous(),
            None if lateral is None else lateral().contiguous(),
        ]
        connections.append(_Connection(*synapse.spreading(), synapse.branches))
    with_gradient = torch.is_grad_enabled()
    with torch.no_grad():
        done = _forward(network, connections, observation, generator, parameters, keep=trace or with_gradient)
    raw = done.raw
    if with_gradient:
        raw = _FusedActor.apply(network, connections, done, observation, *parameters)  # type: ignore[no-untyped-call]
    return raw, done.trace() if trace else Trace(done.spikes, [])


class _Connection(NamedTuple):
    """What a layer's synapses do not learn."""

    matrix: Tensor | None  # the branch weights [d*n, inputs], where they are at hand
    branch: Tensor | None  # of each synapse, [n, inputs], int8, where the weight is to be spread over them
    branches: int  # d; for 1 there is neither


class _Pass(NamedTuple):
    """What a pass leaves."""

    raw: Tensor  # action, [B, M]
    distance: Tensor  # s - mu, [B, N, J]
    strength: Tensor  # A, [B, N, J]
    spikes: Tensor  # of the encoder, [T, B, N*J]
    rates: Tensor  # of the output neurons, [B, M, P]
    block: Tensor  # what the layers did
    layout: _Layout  # of the block

    def trace(self) -> Trace:
        """Spikes and potentials, found in the block."""
        steps, samples, _ = self.spikes.shape
        layers = []
        for n, (spikes, potentials, *_) in zip(self.layout.sizes[1:].tolist(), (self.layout.places // _FLOAT).tolist()):
            count = steps * samples * n
            parts = self.block[spikes : spikes + count], self.block[potentials : potentials + count]
            layers.append((parts[0].view(steps, samples, n), parts[1].view(steps, samples, n)))
        return Trace(self.spikes, layers)


class _Layout(NamedTuple):
    """Where the layers leave what they did."""

    sizes: np.ndarray  # inputs, then the neurons of each layer
    places: np.ndarray  # [L, 4]: of spikes, potentials, largest branches and branch weights, in bytes from the start
    floats: int  # of the block


@lru_cache(maxsize=256)
def _layout(
    spikes: torch.Size,
    parameters: tuple[torch.Size | None, ...],
    branches: tuple[int, ...],
    neighbours: int,
    outputs: int,
    keep: bool,
) -> _Layout:
    """For input spikes ``[T, B, inputs]`` and the shapes of each layer's weight, bias and lateral weights.

    Raises:
        ValueError: shapes that do not fit each other; the kernels, which take addresses, would not notice.
    """
    steps, samples, inputs = spikes
    weights = [shape for shape in parameters[::3] if shape is not None]
    sizes = [inputs, *(n for n, _ in weights)]
    fit = [below for _, below in weights] + [outputs] == sizes
    for n, bias, lateral in zip(sizes[1:], parameters[1::3], parameters[2::3], strict=True):
        fit = fit and bias == (n,) and lateral in (None, (neighbours, n))
    if not fit:
        told = [None if shape is None else [*shape] for shape in parameters]
        raise ValueError(f"parameters that do not fit {inputs} inputs and {outputs} outputs, or each other: {told}")
    places, end = [], 0
    for (n, below), d in zip(weights, branches, strict=True):
        neurons = steps * samples * n
        kept = neurons if keep else 0
        row = []
        for count in (neurons, kept, (kept + _FLOAT - 1) // _FLOAT if d > 1 else 0, d * n * below if d > 1 else 0):
            row.append(end * _FLOAT)
            end += (count + _LINE - 1) // _LINE * _LINE
        places.append(row)
    return _Layout(np.array(sizes, np.int64), np.array(places, np.int64), end)


def _forward(
    network: Network,
    connections: Sequence[_Connection],
    observation: Tensor,
    generator: torch.Generator | None,
    parameters: Sequence[Any],
    keep: bool,
) -> _Pass:
    """Parameters: mean, std, weight and bias of the decoder, then weight, bias and lateral weights of each layer."""
    mean, std, decoder_weight, decoder_bias, *own = parameters
    distance, strength = receptive_fields(observation, mean, std)
    spikes = network.encoder.encode(strength.flatten(1), generator)
    steps, samples, inputs = spikes.shape
    shapes = tuple(None if parameter is None else parameter.shape for parameter in own)
    branches = tuple(connection.branches for connection in connections)
    layout = _layout(spikes.shape, shapes, branches, len(network.offsets), decoder_weight.numel(), keep)
    block, rates = torch.empty(layout.floats), torch.empty(samples, *decoder_weight.shape)
    network_forward_kernel()(
        spikes.view(steps * samples, inputs).numpy(),
        steps,
        samples,
        layout.sizes,
        _table(own, connections),
        layout.places + block.data_ptr(),
        offsets_array(network.offsets),
        *network.constants[:3],
        keep,
        rates.flatten(1).numpy(),
    )
    return _Pass(decode(rates, decoder_weight, decoder_bias), distance, strength, spikes, rates, block, layout)


def _table(own: Sequence[Any], connections: Sequence[_Connection]) -> np.ndarray:
    """The layers' parameters as the kernels take them: addresses, 0 for none."""
    rows = []
    for weight, bias, lateral, (matrix, branch, branches) in zip(
        own[::3], own[1::3], own[2::3], connections, strict=True
    ):
        at_hand = weight if branches == 1 else matrix
        rows.append(
            [
                weight.data_ptr(),
                bias.data_ptr(),
                0 if lateral is None else lateral.data_ptr(),
                0 if lateral is None else lateral.shape[0],
                0 if branch is None else branch.data_ptr(),
                0 if at_hand is None else at_hand.data_ptr(),
                branches,
            ]
        )
    return np.array(rows, np.int64)


class _FusedActor(torch.autograd.Function):
    """A pass that is done, and its gradient by hand."""

    @staticmethod
    def forward(
        ctx: Any,
        network: Network,
        connections: Sequence[_Connection],
        done: _Pass,
        observation: Tensor,
        *parameters: Tensor | None,
    ) -> Tensor:
        """Raw action."""
        ctx.save_for_backward(done.distance, done.strength, done.spikes, done.rates, done.block, *parameters)
        ctx.network, ctx.connections, ctx.layout = network, connections, done.layout
        return done.raw

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, *grads: Tensor) -> tuple[Tensor | None, ...]:
        """Gradients to the observation ``[B, N]`` and to each parameter, as :func:`_forward` takes them."""
        distance, strength, spikes, rates, block, _, std, decoder_weight, _, *own = ctx.saved_tensors
        steps, samples, inputs = spikes.shape
        to_raw, (to_observation, to_mean, to_std) = grads[0], ctx.needs_input_grad[3:6]
        to_rates = to_raw.unsqueeze(-1) * decoder_weight
        to_decoder = (to_raw.unsqueeze(-1) * rates).sum(0), to_raw.sum(0)
        counts, starts = _consecutive(tuple(None if parameter is None else parameter.shape for parameter in own))
        to_own = torch.empty(sum(counts))
        encoder_learns = to_observation or to_mean or to_std
        to_strength = torch.empty(samples if encoder_learns else 0, inputs)
        network_backward_kernel()(
            as_array(to_rates.flatten(1)),
            spikes.view(steps * samples, inputs).numpy(),
            steps,
            samples,
            ctx.layout.sizes,
            _table(own, ctx.connections),
            ctx.layout.places + block.data_ptr(),
            starts + to_own.data_ptr(),
            offsets_array(ctx.network.offsets),
            *ctx.network.constants,
            _coding_gradient(tuple(ctx.network.encoder.coding_gradient())),
            to_strength.numpy(),
        )
        to_encoder: tuple[Tensor | None, ...] = (None, None, None)
        if encoder_learns:
            to_encoder = receptive_field_gradients(
                to_strength.view_as(strength), distance, strength, std, to_observation
            )
        layers = (None if p is None else part.view(p.shape) for part, p in zip(to_own.split(counts), own))
        return None, None, None, *to_encoder, *to_decoder, *layers


@lru_cache
def _consecutive(shapes: tuple[torch.Size | None, ...]) -> tuple[list[int], np.ndarray]:
    """Numbers in each part of a block, and where they begin, ``[L, 3]``, in bytes from its start."""
    counts = [0 if shape is None else shape.numel() for shape in shapes]
    return counts, np.cumsum([0, *counts[:-1]]).reshape(-1, 3) * _FLOAT


@lru_cache
def _coding_gradient(values: tuple[float, ...]) -> np.ndarray:
    return np.array([values], np.float32)
