"""A whole spiking actor without autograd: its layers as one call of a compiled kernel in each direction.

Products this small leave Python and PyTorch as much to do around them as in them. Values and gradients are those of
encoder, layers and decoder one after the other, bit for bit; those serve wherever this does not.

What the layers did lies in one block of memory; their gradients go where they belong.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from src.actors.decoder import decode
from src.actors.health import Trace
from src.actors.kernels import takes_kernel
from src.actors.lif_cpu import offsets_array
from src.actors.lif_kernel import network_backward_kernel, network_forward_kernel
from src.actors.population_encoder import receptive_field_gradients, receptive_fields
from src.actors.spiking_network import Network, Weights
from src.blas import sgemm_address
from src.places import GradientOf, destinations

_FLOAT = 4  # bytes
_LINE = 16  # floats of a cache line, at which each part of what the layers did begins


class Pass(NamedTuple):
    """What a pass leaves; all but the raw actions and the input spikes of the last minibatch."""

    raw: Tensor  # actions of all minibatches, [G, B, M]
    input_spikes: Tensor  # of the encoder, [G, T, B, N*J]
    distance: Tensor  # s - mu, [B, N, J]
    strength: Tensor  # A, [B, N, J]
    rates: Tensor  # of the output neurons, [B, M, P]
    weights: Weights
    block: Tensor  # what the layers did
    layout: _Layout  # of the block

    def trace(self) -> Trace:
        """Spikes and potentials of every layer, found in the block; of a pass that kept them."""
        _, steps, samples, _ = self.input_spikes.shape
        layers = []
        for n, (spikes, potentials, *_) in zip(self.layout.sizes[1:].tolist(), self.last_places().tolist()):
            count = steps * samples * n
            starts = (spikes // _FLOAT, potentials // _FLOAT)
            parts = [self.block[start : start + count].view(steps, samples, n) for start in starts]
            layers.append((parts[0], parts[1]))
        return Trace(self.input_spikes[-1], layers)

    def last_places(self) -> np.ndarray:
        """Where the layers left what they did in the last minibatch, as in the layout."""
        groups, steps, samples, _ = self.input_spikes.shape
        places = self.layout.places.copy()
        places[:, 0] += (groups - 1) * steps * samples * self.layout.sizes[1:] * _FLOAT
        return places


@torch.no_grad()
def fused_actor(
    network: Network, weights: Weights, observation: Tensor, generator: torch.Generator | None, keep: bool
) -> Pass:
    """A pass of the actor over G minibatches, each of which draws its own key of Poisson coding.

    Args:
        network: the actor.
        weights: as it gives them.
        observation: ``[G, B, N]``.
        generator: the stream of Poisson coding.
        keep: whether :meth:`Pass.trace` or :func:`fused_gradient` of the last minibatch is to follow.

    Raises:
        ValueError: an observation of another size; Poisson coding without a generator.
    """
    encoder, decoder = network.encoder, network.decoder
    groups, samples = observation.shape[:2]
    distance, strength = receptive_fields(observation.flatten(0, 1), encoder.mean, encoder.std)
    spikes = strength.new_empty(groups, encoder.time_steps, samples, encoder.size)
    for strengths, train in zip(strength.view(groups, samples, encoder.size), spikes):
        encoder.encode(strengths, generator, out=train)
    layout = _layout(spikes.shape, weights.shapes, len(network.offsets), decoder.weight.numel(), keep)
    block, rates = observation.new_empty(layout.floats), observation.new_empty(groups * samples, *decoder.weight.shape)
    network_forward_kernel()(
        sgemm_address(),
        spikes.data_ptr(),
        groups,
        encoder.time_steps,
        samples,
        layout.sizes,
        weights.table,
        layout.places + block.data_ptr(),
        offsets_array(network.offsets),
        *network.constants[:3],
        keep,
        rates.data_ptr(),
    )
    raw = decode(rates, decoder.weight, decoder.bias).view(groups, samples, len(decoder.weight))
    return Pass(raw, spikes, distance[-samples:], strength[-samples:], rates[-samples:], weights, block, layout)


class _Layout(NamedTuple):
    """Where the layers leave what they did."""

    sizes: np.ndarray  # inputs, then the neurons of each layer
    places: np.ndarray  # [L, 4]: of spikes, potentials, largest branches and branch weights, in bytes from the start
    floats: int  # of the block


@lru_cache(maxsize=256)
def _layout(
    spikes: torch.Size,
    layers: tuple[tuple[torch.Size, torch.Size, torch.Size | None, int], ...],
    neighbours: int,
    outputs: int,
    keep: bool,
) -> _Layout:
    """For input spikes ``[G, T, B, inputs]`` and each layer's d and shapes of its weight, bias and lateral weights.

    Raises:
        ValueError: shapes that do not fit each other; the kernels, which take addresses, would not notice.
    """
    groups, steps, samples, inputs = spikes
    sizes = [inputs, *(weight[0] for weight, *_ in layers)]
    fit = [weight[1] for weight, *_ in layers] + [outputs] == sizes
    for weight, bias, lateral, d in layers:
        fit = fit and bias in (weight[:1], (d, *weight[:1])) and lateral in (None, (neighbours, *weight[:1]))
    if not fit:
        told = [None if shape is None else [*shape] for *shapes, _ in layers for shape in shapes]
        raise ValueError(f"parameters that do not fit {inputs} inputs and {outputs} outputs, or each other: {told}")
    places, end = [], 0
    for (n, below), *_, d in layers:
        neurons = steps * samples * n
        kept = neurons if keep else 0
        row = []
        dendritic = int(d > 1)
        largest_branches = dendritic * (kept + _FLOAT - 1) // _FLOAT
        for count in (groups * neurons, kept, largest_branches, dendritic * d * n * below):
            row.append(end * _FLOAT)
            end += (count + _LINE - 1) // _LINE * _LINE
        places.append(row)
    return _Layout(np.array(sizes, np.int64), np.array(places, np.int64), end)


@torch.no_grad()
def fused_gradient(network: Network, done: Pass, to_raw: Tensor, gradient_of: GradientOf) -> None:
    """The gradient of a pass that kept what it did, while the parameters are as they were.

    Args:
        network: the actor.
        done: its pass.
        to_raw: gradient to the raw action, ``[B, M]``.
        gradient_of: where those of the parameters belong.
    """
    if to_raw.shape != done.raw.shape[1:] or not takes_kernel(to_raw):
        found = f"{[*to_raw.shape]}, {to_raw.dtype}, {to_raw.device}"
        raise ValueError(f"the raw action is {[*done.raw.shape[1:]]}, float32 on the CPU, the gradient to it {found}")
    to = network.places.once(_destinations, network, gradient_of)
    torch.sum(to_raw.unsqueeze(-1) * done.rates, 0, out=to.weight)
    torch.sum(to_raw, 0, out=to.bias)
    spikes = done.input_spikes[-1]
    steps, samples, inputs = spikes.shape
    to_raw, decoder = to_raw.contiguous(), network.decoder.weight.contiguous()
    to_strength = to_raw.new_empty(samples if to.encoder is not None else 0, inputs)
    network_backward_kernel()(
        sgemm_address(),
        to_raw.data_ptr(),
        decoder.data_ptr(),
        to_raw.shape[1],
        spikes.data_ptr(),
        steps,
        samples,
        done.layout.sizes,
        done.weights.table,
        done.last_places() + done.block.data_ptr(),
        to.table,
        offsets_array(network.offsets),
        *network.constants,
        _coding_gradient(tuple(network.encoder.coding_gradient())),
        0 if to.encoder is None else to_strength.data_ptr(),
    )
    for to_rows, to_shared in to.shared_lateral:
        torch.sum(to_rows, 1, out=to_shared)
    if to.encoder is not None:
        to_mean, to_std = to.encoder
        _, mean_gradient, std_gradient = receptive_field_gradients(
            to_strength.view_as(done.strength), done.distance, done.strength, network.encoder.std, to_observation=False
        )
        to_mean.copy_(mean_gradient)
        to_std.copy_(std_gradient)


class _Destinations(NamedTuple):
    """Where the gradients go."""

    weight: Tensor  # of the decoder
    bias: Tensor
    layers: list[list[Tensor]]  # of weight, bias and lateral weights [K, n]; read by nobody: keeps them alive
    table: np.ndarray  # their addresses
    shared_lateral: list[tuple[Tensor, Tensor]]  # [K, n], to be summed to [K]
    encoder: list[Tensor] | None  # of mean and sigma, where one of them learns


def _destinations(network: Network, gradient_of: GradientOf) -> _Destinations:
    encoder, decoder = network.encoder, network.decoder
    weight, bias = destinations([decoder.weight, decoder.bias], gradient_of)
    layers, shared = [], []
    for synapse, lateral in network.layers:
        places = destinations([synapse.weight, synapse.bias], gradient_of)
        if lateral is None:
            places.append(synapse.weight.new_empty(0))
        elif lateral.weight.dim() == 2:
            places += destinations([lateral.weight], gradient_of)
        else:
            places.append(lateral.weight.new_empty(len(lateral.weight), len(synapse.weight)))
            shared.append((places[-1], destinations([lateral.weight], gradient_of)[0]))
        layers.append(places)
    table = np.array([[place.data_ptr() for place in places] for places in layers], np.int64)
    fields = None
    if any(x in gradient_of for x in (encoder.mean, encoder.std)):  # type: ignore[comparison-overlap]
        fields = destinations([encoder.mean, encoder.std], gradient_of)
    return _Destinations(weight, bias, layers, table, shared, fields)


@lru_cache
def _coding_gradient(values: tuple[float, ...]) -> np.ndarray:
    return np.array([values], np.float32)
