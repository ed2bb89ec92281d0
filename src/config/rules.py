"""The rules between keys of a configuration, which no type or range of a single key can state."""

from __future__ import annotations

from collections.abc import Iterator

from src.config.schema import ActorConfig, ExperimentConfig, ProtocolConfig, SACConfig, SpikingActorConfig


def mistakes(config: ExperimentConfig) -> Iterator[str]:
    """Each broken rule as a sentence: the key, what was found, what would be right."""
    actor = config.actor
    algo = config.algo
    yield from _coding_mistakes(config)
    yield from _protocol_mistakes(config.protocol)
    stored = config.protocol.update_after + config.protocol.update_every
    if algo.batch_size > stored and config.protocol.total_steps > config.protocol.update_after:
        yield f"algo.batch_size: {algo.batch_size} is larger than the {stored} steps stored at the first update."
    if config.encoder.mean_range[0] >= config.encoder.mean_range[1]:
        yield f"encoder.mean_range: should rise, found {list(config.encoder.mean_range)}."
    if isinstance(algo, SACConfig):
        if algo.log_std_min >= algo.log_std_max:
            yield f"algo.log_std_min: {algo.log_std_min} should be below algo.log_std_max ({algo.log_std_max})."
        if algo.log_std_network == "shared" and actor.kind != "mlp":
            yield "algo.log_std_network=shared: only actor=aan has a trunk to share; use separate."
    if isinstance(actor, SpikingActorConfig):
        yield from _spiking_mistakes(actor)


def _coding_mistakes(config: ExperimentConfig) -> Iterator[str]:
    actor = config.actor
    encoder = config.encoder
    if takes_strength(actor):
        if encoder.coding != "analog":
            yield (
                f"encoder={encoder.name}: actor {actor.name} takes the stimulation strength itself, no spikes; "
                "leave encoder=task."
            )
    elif actor.spikes and encoder.coding == "none":
        yield f"encoder.coding: actor {actor.name} needs spikes; use encoder=task, poisson or deterministic."
    elif not actor.spikes and encoder.coding != "none":
        yield f"encoder={encoder.name}: actor {actor.name} takes no spikes; leave encoder=task."


def takes_strength(actor: ActorConfig) -> bool:
    """Whether an actor always takes the encoder's stimulation strength instead of spikes."""
    return getattr(actor, "coding", None) == "analog"


def _protocol_mistakes(protocol: ProtocolConfig) -> Iterator[str]:
    total = protocol.total_steps
    interval = protocol.evaluation_interval
    if total < protocol.start_steps:
        yield (
            f"protocol.total_steps: {total} is smaller than protocol.start_steps ({protocol.start_steps}), "
            "so the policy would never act; raise it or lower protocol.start_steps."
        )
    for key in ("total_steps", "start_steps", "update_after", "evaluation_interval", "checkpoint_interval"):
        steps = getattr(protocol, key)
        if steps % protocol.update_every:
            yield f"protocol.{key}: {steps} is not a multiple of protocol.update_every ({protocol.update_every})."
    for key in ("total_steps", "checkpoint_interval"):
        steps = getattr(protocol, key)
        if max(interval, steps) % min(interval, steps):
            yield (
                f"protocol.{key}: {steps} and protocol.evaluation_interval ({interval}) "
                "must be multiples of one another."
            )
    if total < interval:
        yield f"protocol.evaluation_interval: {interval} is larger than total_steps ({total})."


def _spiking_mistakes(actor: SpikingActorConfig) -> Iterator[str]:
    for width in actor.hidden_sizes:
        if actor.lateral.radius >= width:
            yield f"actor.lateral.radius: {actor.lateral.radius} should be smaller than the layer width ({width})."
            break
    for width in actor.hidden_sizes if actor.dendritic.output_topology else actor.hidden_sizes[:-1]:
        if actor.dendritic.branches > width:
            yield f"actor.dendritic.branches: {actor.dendritic.branches} exceeds the {width} inputs of a layer."
            break
    if actor.output_lateral != "none" and actor.dendritic.output_topology and actor.lateral.radius:
        yield (
            f"actor.output_lateral: {actor.output_lateral} and actor.dendritic.output_topology=true would connect the "
            "output population twice; use none, or false."
        )
    if actor.output_lateral == "no_self" and actor.output_population == 1:
        yield "actor.output_lateral: no_self needs at least 2 neurons an action; raise actor.output_population."


def inert_keys(config: ExperimentConfig) -> Iterator[str]:
    """Dotted keys that change nothing in this configuration, because another key switches off what they set."""
    algo = config.algo
    if config.encoder.coding == "none":
        for key in ("population_size", "mean_range", "std", "min_std", "learnable", "threshold", "input_map"):
            yield f"encoder.{key}"
    elif config.encoder.coding != "deterministic":
        yield "encoder.threshold"
    if not isinstance(algo, SACConfig):
        yield "actor.log_std_network"
    elif algo.log_std_network == "shared":
        yield "algo.log_std_hidden_sizes"
        yield "algo.log_std_learning_rate"
    if isinstance(config.actor, SpikingActorConfig):
        yield from _inert_spiking_keys(config.actor)
    if not config.normalize_observations:
        yield "normalization_clip"


def _inert_spiking_keys(actor: SpikingActorConfig) -> Iterator[str]:
    linear = actor.dendritic.branches == 1
    alone = actor.lateral.radius == 0
    if linear:
        yield "actor.dendritic.bias"
        yield "actor.dendritic.init_fan_in"
        yield "actor.mask_seed"
    if alone:
        yield "actor.lateral.include_self"
        yield "actor.lateral.weights"
        yield "actor.lateral.init_scale"
    if alone and actor.output_lateral == "none":
        yield "actor.lateral_gradient"
    if linear and alone:
        yield "actor.dendritic.output_topology"
    if actor.neuron == "dn":
        yield "actor.voltage_decay"
    else:
        yield from (f"actor.dn.theta_{name}" for name in "vurs")
    if actor.output_lateral == "none":
        yield "actor.output_lateral_bias"
    if actor.readout == "rate":
        yield "actor.readout_decay"
