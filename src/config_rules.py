"""The rules between keys of a configuration, which no type or range of a single key can state."""

from __future__ import annotations

from collections.abc import Iterator

from src.config import ExperimentConfig, SACConfig, SpikingActorConfig


def mistakes(c: ExperimentConfig) -> Iterator[str]:
    """Each broken rule as a sentence: the key, what was found, what would be right."""
    p = c.protocol
    if c.actor.spikes and c.encoder.coding == "none":
        yield f"encoder.coding: actor {c.actor.name} needs spikes; use encoder=task, poisson or deterministic."
    if not c.actor.spikes and c.encoder.coding != "none":
        yield f"encoder={c.encoder.name}: actor {c.actor.name} takes no spikes; leave encoder=task."
    if p.total_steps < p.start_steps:
        yield (
            f"protocol.total_steps: {p.total_steps} is smaller than protocol.start_steps ({p.start_steps}), "
            "so the policy would never act; raise it or lower protocol.start_steps."
        )
    for key in ("total_steps", "start_steps", "update_after", "evaluation_interval", "checkpoint_interval"):
        if getattr(p, key) % p.update_every:
            yield f"protocol.{key}: {getattr(p, key)} is not a multiple of protocol.update_every ({p.update_every})."
    for key in ("total_steps", "checkpoint_interval"):
        shorter = min(p.evaluation_interval, getattr(p, key))
        if max(p.evaluation_interval, getattr(p, key)) % shorter:
            yield (
                f"protocol.{key}: {getattr(p, key)} and protocol.evaluation_interval ({p.evaluation_interval}) "
                "must be multiples of one another."
            )
    if p.total_steps < p.evaluation_interval:
        yield f"protocol.evaluation_interval: {p.evaluation_interval} is larger than total_steps ({p.total_steps})."
    stored = p.update_after + p.update_every
    if c.algo.batch_size > stored and p.total_steps > p.update_after:
        yield f"algo.batch_size: {c.algo.batch_size} is larger than the {stored} steps stored at the first update."
    if c.encoder.mean_range[0] >= c.encoder.mean_range[1]:
        yield f"encoder.mean_range: should rise, found {list(c.encoder.mean_range)}."
    if isinstance(c.algo, SACConfig):
        if c.algo.log_std_min >= c.algo.log_std_max:
            yield f"algo.log_std_min: {c.algo.log_std_min} should be below algo.log_std_max ({c.algo.log_std_max})."
        if c.algo.log_std_network == "shared" and c.actor.kind != "mlp":
            yield "algo.log_std_network=shared: only actor=aan has a trunk to share; use separate."
    if isinstance(c.actor, SpikingActorConfig):
        yield from _spiking_mistakes(c.actor)


def _spiking_mistakes(a: SpikingActorConfig) -> Iterator[str]:
    for width in a.hidden_sizes:
        if a.lateral.radius >= width:
            yield f"actor.lateral.radius: {a.lateral.radius} should be smaller than the layer width ({width})."
            break
    for width in a.hidden_sizes if a.dendritic.output_topology else a.hidden_sizes[:-1]:
        if a.dendritic.branches > width:
            yield f"actor.dendritic.branches: {a.dendritic.branches} exceeds the {width} inputs of a layer."
            break
