"""One decision of an actor, layer by layer: what every layer's synapses receive and every neuron gives.

Written on the plain PyTorch functions of :mod:`src.actors`; whatever here counts, draws, disturbs or exports an actor's
insides looks at them through this module.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import NamedTuple, TypeGuard, TypeVar

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from src.actors.actor import Actor
from src.actors.decoder import MembraneReadout
from src.actors.mlp import EnsembleMLP, MLPActor
from src.actors.population_mlp_actor import PopulationMLPActor
from src.actors.spiking_actor import SpikingActor

A = TypeVar("A", bound=Actor)


class Connections(NamedTuple):
    """One call of a connection layer.

    ``inputs`` is what its synapses receive, ``[S, B, inputs]`` over S steps, ``weight`` is ``[outputs, inputs]``. A
    lateral layer has ``offsets``: its weight ``[K, n]`` belongs to the neighbours at these index distances. The
    decoder's weight ``[M, P]`` is ``grouped``: every input has one synapse. Connections within each of M groups of P
    neurons have a weight ``[M, P, P]`` and ``exists``, where there is a synapse.
    """

    name: str
    inputs: Tensor
    weight: Tensor
    offsets: tuple[int, ...] = ()
    grouped: bool = False
    exists: Tensor | None = None


class Neurons(NamedTuple):
    """One layer of neurons: activations ``[S, B, n]`` and, of spiking ones, potentials before the reset."""

    name: str
    activations: Tensor
    potentials: Tensor | None = None


class Trace(NamedTuple):
    """One pass; ``neurons`` are the hidden layers and the output population, in the order of the data."""

    raw: Tensor  # [B, M], before squashing
    connections: list[Connections]
    neurons: list[Neurons]


class NotTraceable(ValueError):
    """Nothing is known of this actor's insides; the message says why."""


def computes_as(actor: Actor, kind: type[A]) -> TypeGuard[A]:
    """Whether it computes what this class of actors does (a subclass with a ``forward`` of its own does not)."""
    return isinstance(actor, kind) and type(actor).forward is kind.forward


@torch.no_grad()
def trace(actor: Actor, observation: Tensor, generator: torch.Generator | None = None) -> Trace:
    """The actor's pass on normalised observations ``[B, N]``, everything kept.

    Of an actor that this project does not know, its ``nn.Linear`` layers are seen, and as neurons what reaches all of
    them but the first.

    Raises:
        NotTraceable: such an actor calls no ``nn.Linear`` layer.
    """
    if computes_as(actor, SpikingActor):
        return _spiking(actor, observation, generator)
    if computes_as(actor, MLPActor):
        return _perceptron(actor, observation)
    if computes_as(actor, PopulationMLPActor):
        return _population_perceptron(actor, observation)
    return _unknown(actor, observation, generator)


def _layers_of(network: EnsembleMLP) -> list[tuple[Tensor, Tensor]]:
    """Weight ``[outputs, inputs]`` and bias ``[outputs]`` of each layer, input first; views of the parameters."""
    return [(weight[0].T, bias[0, 0]) for weight, bias in zip(network.weights, network.biases, strict=True)]


class Layer(NamedTuple):
    """Weights and bias of one connection layer, in the parameters' memory: writing into them changes the actor."""

    name: str
    weight: Tensor
    bias: Tensor | None


def weighted_layers(actor: Actor) -> list[Layer]:
    """Every connection layer in the order of the data; of an unknown actor its ``nn.Linear`` layers."""
    if computes_as(actor, MLPActor):
        return [
            Layer(f"layer{n}", *parts)
            for n, parts in enumerate(_layers_of(actor.hidden) + _layers_of(actor.output), start=1)
        ]
    if computes_as(actor, PopulationMLPActor):
        hidden = [Layer(f"layer{n}", *parts) for n, parts in enumerate(_layers_of(actor.hidden), start=1)]
        return [*hidden, Layer("decoder", actor.decoder.weight, actor.decoder.bias)]
    if not computes_as(actor, SpikingActor):
        linear = [(name, module) for name, module in actor.named_modules() if isinstance(module, nn.Linear)]
        return [Layer(name, module.weight, module.bias) for name, module in linear]
    layers = []
    for number, layer in enumerate(actor.spiking_layers(), start=1):
        layers.append(Layer(f"layer{number}", layer.synapse.weight, layer.synapse.bias))
        if layer.lateral is not None:
            layers.append(Layer(f"layer{number}.lateral", layer.lateral.weight, None))
        if layer.output_lateral is not None:
            layers.append(Layer(f"layer{number}.output_lateral", layer.output_lateral.weight, None))
    return [*layers, Layer("decoder", actor.decoder.weight, actor.decoder.bias)]


def _spiking(actor: SpikingActor, observation: Tensor, generator: torch.Generator | None) -> Trace:
    activity = actor.activity(observation, generator)
    spikes = activity.input_spikes
    connections, neurons = [], []
    for number, (layer, (fired, potentials)) in enumerate(zip(actor.spiking_layers(), activity.layers), start=1):
        name = f"layer{number}"
        connections.append(Connections(name, spikes, layer.synapse.weight))
        before = torch.cat([torch.zeros_like(fired[:1]), fired[:-1]])
        if layer.lateral is not None:
            connections.append(Connections(f"{name}.lateral", before, layer.lateral(), layer.lateral.offsets))
        if (within := layer.output_lateral) is not None:
            weight = within.matrix()
            connections.append(Connections(f"{name}.output_lateral", before, weight, exists=within.exists))
        neurons.append(Neurons(name, fired, potentials))
        spikes = fired
    read = spikes if isinstance(actor.decoder, MembraneReadout) else spikes.mean(0, keepdim=True)
    connections.append(Connections("decoder", read, actor.decoder.weight, grouped=True))
    return Trace(actor.decoder(spikes), connections, neurons)


def _perceptron(actor: MLPActor, observation: Tensor) -> Trace:
    connections, neurons = _hidden_layers(actor.hidden, observation)
    ((weight, bias),) = _layers_of(actor.output)
    x = neurons[-1].activations
    return Trace(F.linear(x, weight, bias)[0], [*connections, Connections("output", x, weight)], neurons)


def _population_perceptron(actor: PopulationMLPActor, observation: Tensor) -> Trace:
    connections, neurons = _hidden_layers(actor.hidden, actor.encoder.strength(observation))
    x = neurons[-1].activations
    decoder = Connections("decoder", x, actor.decoder.weight, grouped=True)
    return Trace(actor.decoder(x), [*connections, decoder], neurons)


def _hidden_layers(network: EnsembleMLP, x: Tensor) -> tuple[list[Connections], list[Neurons]]:
    """ReLU layers, the first of which takes ``x [B, inputs]``."""
    connections, neurons = [], []
    x = x.unsqueeze(0)
    for number, (weight, bias) in enumerate(_layers_of(network), start=1):
        connections.append(Connections(f"layer{number}", x, weight))
        x = torch.relu(F.linear(x, weight, bias))
        neurons.append(Neurons(f"layer{number}", x))
    return connections, neurons


def _unknown(actor: Actor, observation: Tensor, generator: torch.Generator | None) -> Trace:
    with _linear_calls(actor) as connections:
        raw = actor(observation, generator)
    if not connections:
        raise NotTraceable(f"{type(actor).__name__} calls no nn.Linear layer, so nothing of it could be counted")
    first = connections[0].name
    return Trace(raw, connections, [Neurons(c.name, c.inputs) for c in connections if c.name != first])


@contextmanager
def _linear_calls(actor: Actor) -> Iterator[list[Connections]]:
    """Within, every call of an ``nn.Linear`` of the actor is appended to the list."""
    calls: list[Connections] = []
    handles = []
    for name, module in actor.named_modules():
        if isinstance(module, nn.Linear):

            def note(module: nn.Linear, inputs: tuple[Tensor, ...], _: Tensor, name: str = name) -> None:
                calls.append(Connections(name, inputs[0].reshape(1, -1, module.in_features), module.weight))

            handles.append(module.register_forward_hook(note))
    try:
        yield calls
    finally:
        for handle in handles:
            handle.remove()
