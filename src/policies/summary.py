"""A short text about an episode: rates, silent and saturated neurons, operations per decision."""

from __future__ import annotations

from collections.abc import Sequence

from src.policies.episode import Episode, Population
from src.policies.operations import Operations
from src.training.policy_file import PolicyRecord


def title(actor: str, task: str, episode: Episode) -> str:
    """``BPT-SAN's label on HalfCheetah-v4: return 3,210 in 1,000 steps``."""
    return f"{actor} on {task}: return {episode.episode_return:,.0f} in {len(episode.rewards):,} steps"


def text(heading: str, record: PolicyRecord | None, seed: int, episode: Episode) -> str:
    """The whole text, lines of at most 100 characters."""
    lines = [heading, f"episode of seed {seed}" + (f", {describe(record)}" if record else ""), ""]
    if episode.operations is None:
        return "\n".join([*lines, "This actor calls no nn.Linear layer: nothing of its inside can be shown.", ""])
    lines += [*_populations(episode.populations), "", *_operations(episode.operations), ""]
    return "\n".join(lines)


def describe(record: PolicyRecord) -> str:
    """When the policy was kept, and its evaluation then."""
    return f"policy of step {record.step:,}, mean return of its evaluation {record.mean_return:,.1f}"


def _populations(populations: Sequence[Population]) -> list[str]:
    lines = [f"{'population':<12}{'size':>6}{'mean rate':>11}{'always on':>11}{'never on':>10}"]
    for population in populations:
        active = population.rates if population.spiking else population.rates != 0
        always, never = (active == 1).all(axis=0).mean(), (active == 0).all(axis=0).mean()
        size = population.rates.shape[1]
        lines.append(f"{population.name:<12}{size:>6}{active.mean():>11.3f}{always:>11.1%}{never:>10.1%}")
    lines.append("mean rate: spikes per neuron and time step; of real activations the share that is not 0")
    return lines


def _operations(operations: Operations) -> list[str]:
    lines = ["operations per decision (effective of dense)"]
    lines += [
        f"  {layer.name:<16}{layer.effective:>12,.0f} of {layer.dense:>9,.0f} {layer.kind}s"
        for layer in operations.layers
    ]
    lines.append(f"  {'neuron updates':<16}{operations.neuron_updates:>12,.0f} by {operations.neurons:,} neurons")
    if operations.encoder_exponentials:
        lines.append(f"  {'exponentials':<16}{operations.encoder_exponentials:>12,.0f} in the encoder")
    if operations.random_numbers:
        lines.append(f"  {'random numbers':<16}{operations.random_numbers:>12,.0f} in the encoder")
    return lines
