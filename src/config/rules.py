"""The rules between keys of a configuration, which no type or range of a single key can state."""

from __future__ import annotations

from collections.abc import Iterator

from src.config.schema import ActorConfig, Coding, ExperimentConfig, ProtocolConfig, SACConfig, SpikingActorConfig


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


def resolved_coding(config: ExperimentConfig) -> Coding:
    """The encoder's coding; with ``encoder=task`` that of the task, if the actor takes spikes, else what it takes."""
    own = _own_coding(config.actor)
    return own if own is not None and config.encoder.name == "task" else config.encoder.coding


def _own_coding(actor: ActorConfig) -> Coding | None:
    """What an actor takes whatever the task says; None: spikes of either coding."""
    if getattr(actor, "coding", None) == "analog":  # the stimulation strength itself
        return "analog"
    return None if actor.spikes else "none"


def _coding_mistakes(config: ExperimentConfig) -> Iterator[str]:
    actor = config.actor
    encoder = config.encoder
    own = _own_coding(actor)
    if own is None and encoder.coding == "none":
        yield f"encoder.coding: actor {actor.name} needs spikes; use encoder=task, poisson or deterministic."
    elif own is not None and encoder.coding != own:
        takes = "the stimulation strength itself, no spikes" if own == "analog" else "no spikes"
        yield f"encoder={encoder.name}: actor {actor.name} takes {takes}; leave encoder=task."


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
    coding = config.encoder.coding
    receptive_fields = ("population_size", "mean_range", "std", "min_std", "learnable", "input_map")
    switched_off = {
        tuple(f"encoder.{key}" for key in receptive_fields): coding == "none",
        ("encoder.threshold",): coding != "deterministic",
        ("actor.log_std_network",): not isinstance(algo, SACConfig),
        ("algo.log_std_hidden_sizes", "algo.log_std_learning_rate"): isinstance(algo, SACConfig)
        and algo.log_std_network == "shared",
        ("normalization_clip",): not config.normalize_observations,
    }
    if isinstance(config.actor, SpikingActorConfig):
        switched_off |= _inert_spiking_keys(config.actor)
    return (key for keys, off in switched_off.items() if off for key in keys)


def _inert_spiking_keys(actor: SpikingActorConfig) -> dict[tuple[str, ...], bool]:
    linear = actor.dendritic.branches == 1
    alone = actor.lateral.radius == 0
    output_alone = actor.output_lateral == "none"
    return {
        ("actor.dendritic.bias", "actor.dendritic.init_fan_in", "actor.mask_seed"): linear,
        ("actor.lateral.include_self", "actor.lateral.weights", "actor.lateral.init_scale"): alone,
        ("actor.lateral_gradient",): alone and output_alone,
        ("actor.dendritic.output_topology",): linear and alone,
        ("actor.voltage_decay",): actor.neuron == "dn",
        tuple(f"actor.dn.theta_{name}" for name in "vurs"): actor.neuron != "dn",
        ("actor.output_lateral_bias",): output_alone,
        ("actor.readout_decay",): actor.readout == "rate",
    }
