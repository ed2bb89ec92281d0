"""What :func:`src.algorithms.build.build_learner` asks of the engine: which actors it supports; its algorithms."""

from __future__ import annotations

from collections.abc import Callable

import torch
from torch import Tensor
from torch.nn.utils import parametrize

from src.actors.actor import Actor
from src.actors.decoder import MembraneReadout
from src.actors.lif import LIFConstants
from src.actors.mlp import MLPActor
from src.actors.spiking_actor import SpikingActor
from src.config.schema import AlgoConfig, TD3ProxyConfig
from src.engine import sac, td3
from src.engine.flat import FlatParameters
from src.engine.learner import bind

TD3, SAC = td3.FastTD3, sac.FastSAC


def acting(actor: Actor) -> Callable[[Tensor, torch.Generator], Tensor]:
    """The actor's output ``[B, M]`` for ``[B, N]`` as a fast learner acts.

    Its parameters move into a flat tensor, as a learner's do.
    """
    FlatParameters(actor.parameters())
    return bind(actor).raw_action


def unsupported_reason(actor: Actor, device: str = "cpu") -> str | None:
    """Why the engine does not support an actor; None where it does.

    It supports exactly the AAN and the spiking actor (a subclass may compute something else), in float32 on the CPU,
    all of whose parameters are plain and learn.
    """
    if type(actor) not in (MLPActor, SpikingActor):
        return f"it knows the AAN and the spiking actors of this project, not {type(actor).__name__}"
    tensors = [*actor.parameters(), *(buffer for buffer in actor.buffers() if buffer.is_floating_point())]
    if not device.startswith("cpu") or any(tensor.device.type != "cpu" for tensor in tensors):
        return "it computes on the CPU only"
    if any(tensor.dtype != torch.float32 for tensor in tensors):
        return "it computes in float32 only"
    if isinstance(actor, SpikingActor) and (choice := _unknown_choice(actor)):
        return f"it does not compute {choice}"
    if any(not p.requires_grad for p in actor.parameters()):
        return "some of its parameters do not learn"
    if len(list(actor.parameters())) != len(list(actor.named_parameters(remove_duplicate=False))):
        return "one of its parameters serves twice"
    if any(parametrize.is_parametrized(module) for module in actor.modules()):
        return "some of its parameters are made of others"
    return None


def unsupported_algorithm(algo: AlgoConfig) -> str | None:
    """Why the engine does not support an algorithm, whatever the actor; None where it does."""
    return "it computes TD3 and SAC, no proxy target" if isinstance(algo, TD3ProxyConfig) else None


def _unknown_choice(actor: SpikingActor) -> str | None:
    """The first of a spiking actor's choices that has no kernel."""
    layers = actor.spiking_layers()
    if actor.encoder.coding == "analog":
        return "analog input (encoder.coding)"
    if actor.encoder.input_map != "none":
        return f"encoder.input_map={actor.encoder.input_map}"
    if any(not isinstance(layer.constants, LIFConstants) for layer in layers):
        return "other neurons than clif (actor.neuron)"
    if any(layer.output_lateral is not None for layer in layers):
        return "connections within the output population (actor.output_lateral)"
    if isinstance(actor.decoder, MembraneReadout):
        return "membrane readouts (actor.readout)"
    return None
