"""Graded disturbances of a trained policy: of what it observes, of its weights, of its neurons.

The first four are BDETT's (Ding et al., "Biologically Inspired Dynamic Thresholds for Spiking Neural Networks", NeurIPS
2022), at its severity, half and double of it. Every disturbance draws from streams of its own, the same numbers at each
severity, so that a larger one is the smaller one scaled (of shares: contains it). Severity 0 changes nothing.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import gymnasium
import mujoco
import numpy as np
import torch
from torch import Tensor

from src.actors.actor import Actor
from src.actors.lif import LIFConstants
from src.actors.mlp import MLPActor
from src.actors.population_mlp_actor import PopulationMLPActor
from src.actors.spiking_actor import SpikingActor
from src.config.schema import ConfigurationError
from src.policies.trace import computes_as, weighted_layers
from src.streams import Streams

#: A bias at which no neuron fires and no ReLU opens.
SILENT = -1e6

#: A disturbance of observations, ``[N] -> [N]``.
Disturb = Callable[[np.ndarray], np.ndarray]


class Joints(NamedTuple):
    """Places of the actuated joints in an observation: of their positions and of their velocities."""

    positions: list[int]
    velocities: list[int]


def joints_of(environment: gymnasium.Env) -> Joints:
    """Read off the MuJoCo model: Gymnasium's tasks observe positions without those of the plane, then velocities.

    Raises:
        ConfigurationError: the observation of this task is laid out differently.
    """
    task: Any = environment.unwrapped
    model, data = task.model, task.data
    observation = np.asarray(environment.reset(seed=0)[0])
    hidden = 2 if model.jnt_type[0] == mujoco.mjtJoint.mjJNT_FREE else 1
    positions, actuated = model.nq - hidden, model.nu
    whole = np.concatenate([data.qpos[hidden:], np.clip(data.qvel, -10, 10)])
    if len(observation) < len(whole) or not np.allclose(observation[: len(whole)], whole):
        raise ConfigurationError(
            f"{environment.spec.id if environment.spec else task}: does not observe joint positions and then "
            "velocities, so no joint can be disturbed."
        )
    end = positions + model.nv
    return Joints(list(range(positions - actuated, positions)), list(range(end - actuated, end)))


def noisy(generator: np.random.Generator, severity: float) -> Disturb:
    """Observation + N(0, severity)."""
    return lambda observation: observation + severity * generator.standard_normal(len(observation))


def replaced(generator: np.random.Generator, indices: list[int], severity: float) -> Disturb:
    """One of the dimensions ``indices``, drawn once for the episode, is N(0, severity) at every step."""
    index = indices[int(generator.integers(len(indices)))]

    def disturb(observation: np.ndarray) -> np.ndarray:
        observation = observation.copy()
        observation[index] = severity * generator.standard_normal()
        return observation

    return disturb


@torch.no_grad()
def add_weight_noise(actor: Actor, streams: Streams, severity: float) -> None:
    """Every weight + N(0, severity); biases and the encoder stay."""
    for name, weight, _ in weighted_layers(actor):
        noise = torch.randn(weight.shape, generator=streams.torch("weight noise", name))
        weight.add_(noise, alpha=severity)


@torch.no_grad()
def zero_synapses(actor: Actor, streams: Streams, severity: float) -> None:
    """Set a share ``severity`` of the weights of each layer to 0."""
    for name, weight, _ in weighted_layers(actor):
        weight[torch.rand(weight.shape, generator=streams.torch("zeroed synapses", name)) < severity] = 0.0


@torch.no_grad()
def round_weights(actor: Actor, streams: Streams, bits: float) -> None:
    """Weights and bias of each layer in ``2^bits - 1`` steps from 0 to the largest magnitude, both signs alike.

    8 bits are ``round(w 255 / max|w, b|)``, the rounding of the PopSAN authors' port to Loihi, whose weights have
    8 bits besides their sign. Draws nothing.
    """
    steps = 2 ** int(bits) - 1
    for _, weight, bias in weighted_layers(actor):
        parts: list[Tensor] = [weight] if bias is None else [weight, bias]
        largest = max(float(part.abs().max()) for part in parts)
        if largest > 0:
            for part in parts:
                part.copy_(torch.round(part * (steps / largest)) * (largest / steps))


def can_be_silenced(actor: Actor) -> bool:
    """Whether a low enough bias silences its neurons: not dynamic ones, whose potential is squared, nor unknown."""
    if computes_as(actor, SpikingActor):
        return all(isinstance(layer.constants, LIFConstants) for layer in actor.spiking_layers())
    return computes_as(actor, MLPActor) or computes_as(actor, PopulationMLPActor)


@torch.no_grad()
def silence_neurons(actor: Actor, streams: Streams, severity: float) -> None:
    """A share ``severity`` of the neurons of each hidden layer never fires (a ReLU unit is 0).

    Raises:
        ConfigurationError: see :func:`can_be_silenced`.
    """
    if not can_be_silenced(actor):
        raise ConfigurationError(f"{type(actor).__name__}: it is not known how to silence its neurons.")
    hidden = [layer for layer in weighted_layers(actor) if layer.bias is not None]
    spared = 1 if computes_as(actor, MLPActor) else 2  # the linear output, or output population and decoder
    for name, _, bias in hidden[:-spared]:
        assert bias is not None
        dead = torch.rand(bias.shape[-1], generator=streams.torch("dead neurons", name)) < severity
        bias[..., dead] = SILENT
