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
from src.actors.kernels import takes_kernel
from src.actors.lif_cpu import offsets_array
from src.actors.lif_kernel import network_backward_kernel, network_forward_kernel
from src.actors.population_encoder import PopulationEncoder, receptive_field_gradients, receptive_fields
from src.actors.spiking_layer import SpikingLayer

_FLOAT = 4  # bytes
_LINE = 16  # floats of a cache line, at which each part of a block begins


class Network:
    """The parts of a spiking actor, at hand: a module takes its time to find one."""

    def __init__(self, encoder: PopulationEncoder, layers: Sequence[SpikingLayer], decoder: PopulationDecoder) -> None:
        self.encoder, self.decoder = encoder, decoder
        self.layers = [(layer.synapse, layer.lateral) for layer in layers]
        self.offsets = next((layer.lateral.offsets for layer in layers if layer.lateral is not None), ())
        self.constants = layers[0].constants
        self.bias_per_neuron = not any(layer.synapse.bias_per_branch for layer in layers)

    def takes(self, observation: Tensor) -> bool:
        """Whether :func:`fused_actor` serves: float32 on the CPU, a bias for each neuron."""
        return self.bias_per_neuron and takes_kernel(observation) and takes_kernel(self.decoder.weight)


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
    call = _Call(network, connections, generator)
    passes: list[_Pass] = []
    if torch.is_grad_enabled():
        raw: Tensor = _FusedActor.apply(call, passes, observation, *parameters)  # type: ignore[no-untyped-call]
    else:
        passes.append(_forward(call, observation, parameters, keep=trace))
        raw = passes[0].raw
    return raw, passes[0].trace() if trace else Trace(passes[0].spikes, [])


class _Connection(NamedTuple):
    """What a layer's synapses do not learn."""

    matrix: Tensor | None  # the branch weights [d*n, inputs]; None: to be spread from the weight
    branch: Tensor | None  # of each synapse, [n, inputs], int8, where the weight is to be spread
    branches: int  # d


class _Call(NamedTuple):
    """What a pass is given beside observation and parameters."""

    network: Network
    connections: list[_Connection]
    generator: torch.Generator | None


class _Pass(NamedTuple):
    """What a pass leaves."""

    raw: Tensor  # action, [B, M]
    distance: Tensor  # s - mu, [B, N, J]
    strength: Tensor  # A, [B, N, J]
    spikes: Tensor  # of the encoder, [T, B, N*J]
    rates: Tensor  # of the output neurons, [B, M, P]
    block: Tensor  # what the layers did
    layout: _Layout  # of the block
    table: np.ndarray  # of the parameters, as the kernels take it

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
    spikes: torch.Size, weights: tuple[torch.Size, ...], branches: tuple[int, ...], outputs: int, keep: bool
) -> _Layout:
    """For ``[T, B, inputs]`` and ``[n, inputs]``; raises ValueError where a layer does not fit the one before."""
    steps, samples, _ = spikes
    sizes = [spikes[2], *(weight[0] for weight in weights)]
    if [weight[1] for weight in weights] + [outputs] != sizes:
        raise ValueError(f"layers that do not fit each other: inputs {spikes[2]}, weights {[[*w] for w in weights]}")
    places, end = [], 0
    for (n, inputs), d in zip(weights, branches, strict=True):
        neurons = steps * samples * n
        kept = neurons if keep else 0
        row = []
        for count in (neurons, kept, (kept + _FLOAT - 1) // _FLOAT if d > 1 else 0, d * n * inputs if d > 1 else 0):
            row.append(end * _FLOAT)
            end += (count + _LINE - 1) // _LINE * _LINE
        places.append(row)
    return _Layout(np.array(sizes, np.int64), np.array(places, np.int64), end)


def _forward(call: _Call, observation: Tensor, parameters: Sequence[Any], keep: bool) -> _Pass:
    """Parameters: mean, std, weight and bias of the decoder, then weight, bias and lateral weights of each layer."""
    mean, std, decoder_weight, decoder_bias, *own = parameters
    distance, strength = receptive_fields(observation, mean, std)
    spikes = call.network.encoder.encode(strength.flatten(1), call.generator)
    steps, samples, inputs = spikes.shape
    branches = tuple(connection.branches for connection in call.connections)
    weights = tuple(weight.shape for weight in own[::3])
    layout = _layout(spikes.shape, weights, branches, decoder_weight.numel(), keep)
    rows = zip(own[::3], own[1::3], own[2::3], call.connections, strict=True)
    table = np.array([_row(*row) for row in rows])
    block, rates = torch.empty(layout.floats), torch.empty(samples, *decoder_weight.shape)
    network_forward_kernel()(
        spikes.view(steps * samples, inputs).numpy(),
        steps,
        samples,
        layout.sizes,
        table,
        layout.places + block.data_ptr(),
        offsets_array(call.network.offsets),
        *call.network.constants[:3],
        keep,
        rates.flatten(1).numpy(),
    )
    raw = decode(rates, decoder_weight, decoder_bias)
    return _Pass(raw, distance, strength, spikes, rates, block, layout, table)


def _row(weight: Tensor, bias: Tensor, lateral: Tensor | None, connection: _Connection) -> list[int]:
    matrix, branch, branches = connection
    return [
        weight.data_ptr(),
        bias.data_ptr(),
        0 if lateral is None else lateral.data_ptr(),
        0 if lateral is None else lateral.shape[0],
        0 if branch is None else branch.data_ptr(),
        0 if matrix is None else matrix.data_ptr(),
        branches,
    ]


class _FusedActor(torch.autograd.Function):
    """:func:`_forward` and its gradient by hand."""

    @staticmethod
    def forward(ctx: Any, call: _Call, passes: list[_Pass], observation: Tensor, *parameters: Tensor | None) -> Tensor:
        """Raw action; the pass is appended to ``passes``."""
        done = _forward(call, observation, parameters, keep=True)
        passes.append(done)
        ctx.save_for_backward(done.distance, done.strength, done.spikes, done.rates, done.block, *parameters)
        ctx.call, ctx.layout, ctx.table = call, done.layout, done.table
        return done.raw

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, *grads: Tensor) -> tuple[Tensor | None, ...]:
        """Gradients to the observation ``[B, N]`` and to each parameter, as :func:`_forward` takes them."""
        distance, strength, spikes, rates, block, _, std, decoder_weight, _, *own = ctx.saved_tensors
        steps, samples, inputs = spikes.shape
        to_raw, needed = grads[0], ctx.needs_input_grad[2:]
        to_rates = to_raw.unsqueeze(-1) * decoder_weight
        to_decoder = (to_raw.unsqueeze(-1) * rates).sum(0), to_raw.sum(0)
        counts, starts = _consecutive(tuple(None if parameter is None else parameter.shape for parameter in own))
        to_own = torch.empty(sum(counts))
        encoder_learns = any(needed[:3])
        to_strength = torch.empty(samples if encoder_learns else 0, inputs)
        network_backward_kernel()(
            to_rates.flatten(1).numpy(),
            spikes.view(steps * samples, inputs).numpy(),
            steps,
            samples,
            ctx.layout.sizes,
            ctx.table,
            ctx.layout.places + block.data_ptr(),
            starts + to_own.data_ptr(),
            offsets_array(ctx.call.network.offsets),
            *ctx.call.network.constants,
            _coding_gradient(tuple(ctx.call.network.encoder.coding_gradient())),
            to_strength.numpy(),
        )
        to_encoder: tuple[Tensor | None, ...] = (None, None, None)
        if encoder_learns:
            to_encoder = receptive_field_gradients(
                to_strength.view_as(strength), distance, strength, std, to_observation=needed[0]
            )
        layers = (part if p is None else part.view(p.shape) for part, p in zip(to_own.split(counts), own))
        every = (*to_encoder, *to_decoder, *layers)
        return None, None, *(g if wanted else None for g, wanted in zip(every, needed, strict=True))


@lru_cache
def _consecutive(shapes: tuple[torch.Size | None, ...]) -> tuple[list[int], np.ndarray]:
    """Numbers in each part of a block, and where they begin, ``[L, 3]``, in bytes from its start."""
    counts = [0 if shape is None else shape.numel() for shape in shapes]
    return counts, np.cumsum([0, *counts[:-1]]).reshape(-1, 3) * _FLOAT


@lru_cache
def _coding_gradient(values: tuple[float, ...]) -> np.ndarray:
    return np.array([values], np.float32)
