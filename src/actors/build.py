"""From a configuration to an actor: the one place that knows them all."""

from __future__ import annotations

import importlib
import inspect

import torch

from src.actors.actor import Actor
from src.actors.mlp import MLPActor
from src.actors.population_encoder import PopulationEncoder
from src.actors.population_mlp_actor import PopulationMLPActor
from src.actors.spiking_actor import SpikingActor
from src.config.schema import (
    ConfigurationError,
    CustomActorConfig,
    ExperimentConfig,
    MLPActorConfig,
    PopulationMLPActorConfig,
)
from src.streams import Streams

#: T of the encoder handed to a custom actor that names no ``time_steps`` among its arguments.
DEFAULT_TIME_STEPS = 5


def build_actor(config: ExperimentConfig, observation_size: int, action_size: int, streams: Streams) -> Actor:
    """The actor of a configuration, on the CPU, initialised from its own streams.

    Args:
        config: the validated configuration.
        observation_size: N.
        action_size: M.
        streams: the run's random streams.

    Returns:
        The actor of the configured kind.

    Raises:
        ConfigurationError: a custom actor that cannot be imported or built; more branches than inputs.
    """
    if isinstance(config.actor, MLPActorConfig):
        return MLPActor(config.actor, observation_size, action_size, streams)
    if isinstance(config.actor, PopulationMLPActorConfig):
        return PopulationMLPActor(config.actor, config.encoder, observation_size, action_size, streams)
    if isinstance(config.actor, CustomActorConfig):
        return _custom_actor(config, config.actor, observation_size, action_size, streams)
    return SpikingActor(config.actor, config.encoder, observation_size, action_size, streams)


def _custom_actor(
    config: ExperimentConfig, actor: CustomActorConfig, observation_size: int, action_size: int, streams: Streams
) -> Actor:
    module_name, _, class_name = actor.target.rpartition(".")
    try:
        target = getattr(importlib.import_module(module_name), class_name)
    except (ImportError, AttributeError) as error:
        raise ConfigurationError(f"actor.target: cannot import {actor.target} ({error}).") from error
    encoder = None
    if actor.spikes:
        time_steps = actor.arguments.get("time_steps", DEFAULT_TIME_STEPS)
        encoder = PopulationEncoder(config.encoder, observation_size, time_steps)
    sizes = {"observation_size": observation_size, "action_size": action_size}
    try:
        inspect.signature(target).bind(**sizes, streams=streams, encoder=encoder, **actor.arguments)
    except TypeError as error:
        raise ConfigurationError(f"actor.arguments: {actor.target} does not take them ({error}).") from error
    with torch.random.fork_rng(devices=[]):  # torch.nn's own initialisation draws from the global generator
        torch.manual_seed(streams.integer("initialisation", "actor"))
        built = target(**sizes, streams=streams, encoder=encoder, **actor.arguments)
    if not isinstance(built, Actor):
        raise ConfigurationError(
            f"actor.target: {actor.target} should be a subclass of src.actors.actor.Actor, is {type(built).__name__}."
        )
    return built
