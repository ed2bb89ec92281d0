"""Actors on which products are exact, so that equality can be asked for whatever library multiplies."""

from __future__ import annotations

import torch

from src.actors.build import build_actor
from src.streams import Streams
from tests.helpers import make_config

OBSERVATION_SIZE, ACTION_SIZE = 11, 3


def actor(name="bptsan", encoder="deterministic", **overrides):
    """The actor of a configuration; overrides are dotted keys with ``__`` for the dot."""
    encoder = "task" if name == "aan" else encoder
    dotted = {key.replace("__", "."): value for key, value in overrides.items()}
    config = make_config(dotted, actor=name, encoder=encoder)
    return build_actor(config, OBSERVATION_SIZE, ACTION_SIZE, Streams(0))


def exact(built):
    """Weights and biases of synapses as multiples of 2**-12: sums of spikes are then exact in float32, in any order."""
    with torch.no_grad():
        for layer in built.spiking_layers():
            for parameter in (layer.synapse.weight, layer.synapse.bias):
                parameter.copy_((parameter * 2**12).round() / 2**12)
    return built


def autograd(built, observation, grad_raw, generator):
    """Raw action, health, and the gradient of each parameter by autograd through the plain modules."""
    raw, health = built.forward_with_health(observation, generator)
    parameters = list(built.parameters())
    gradients = torch.autograd.grad(raw, parameters, grad_raw, allow_unused=True, materialize_grads=True)
    return raw.detach(), health, dict(zip(parameters, gradients, strict=True))
