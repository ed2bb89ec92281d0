"""Operations and energy of one decision, from layer sizes and measured firing rates.

A spiking layer's synaptic operations per decision are its input spikes times its fan-out, summed over the T steps:
``T * rate * n_in * n_out``; each is one accumulate. A dendritic neuron reads every input on exactly one branch, so
its synapses
count once. A lateral spike at step tau reaches its neighbours at tau + 1, so ``(T - 1) * rate * connections``. An
artificial
layer does ``n_in * n_out`` multiply-accumulates (MACs). A LIF neuron multiplies its current and its membrane by their
decays at every step, spikes or not: ``2 T`` MACs, which no sparsity saves.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any, NamedTuple

MAC_PICOJOULE = 4.6
ACCUMULATE_PICOJOULE = 0.9
ASSUMPTIONS = (
    "45 nm CMOS, 32-bit floating point: 4.6 pJ a multiply-accumulate (MAC), 0.9 pJ an accumulate (AC).",
    "Counted for a spiking actor: one AC per synaptic operation (input spikes times fan-out, summed over T steps), per "
    "lateral operation, and per bias and step; 2 MACs per LIF neuron and step (the decays of current and membrane); in "
    "the encoder 2 MACs per receptive field (square, scale; the exponential is free) and, under deterministic "
    "coding, T "
    "ACs; in the decoder one MAC per output neuron and one AC per action.",
    "Counted for an artificial actor: one MAC per weight, one AC per bias.",
    "Not counted, for anyone: memory traffic, activation functions, comparisons with the threshold and resets, the "
    "maximum over branches, random numbers, observation normalisation, and SAC's log-std network, which deterministic "
    "decisions do not use.",
    "Firing rates are those of training batches in the last 10% of the steps, averaged over the seeds that came "
    "so far. It is an "
    "estimate of arithmetic, not a measurement of a chip.",
)


class Cost(NamedTuple):
    """Per decision. Connections and parameters are those of the actor's mean."""

    synaptic_operations: float  # of the inter-layer synapses, ACs
    lateral_operations: float  # ACs
    encoder_accumulates: float  # ACs
    bias_accumulates: float  # ACs
    macs: float  # encoder, neurons and decoder of a spiking actor; all weights of an artificial one
    connections: int  # inter-layer
    lateral_connections: int

    @property
    def nanojoule(self) -> float:
        """The energy estimate."""
        accumulates = sum(self[:4])
        return (accumulates * ACCUMULATE_PICOJOULE + self.macs * MAC_PICOJOULE) / 1000


def lateral_connections(width: int, radius: int, include_self: bool = False) -> int:
    """Ordered pairs of neurons at index distance 1..radius on a line of ``width`` (ends have fewer neighbours)."""
    return sum(2 * (width - distance) for distance in range(1, min(radius, width - 1) + 1)) + (
        width if include_self else 0
    )


def mlp_cost(sizes: list[int]) -> Cost:
    """An artificial actor ``sizes[0] -> ... -> sizes[-1]``."""
    macs = sum(a * b for a, b in pairwise(sizes))
    return Cost(0.0, 0.0, 0.0, float(sum(sizes[1:])), float(macs), macs, 0)


def spiking_cost(config: dict[str, Any], observation_size: int, action_size: int, rates: list[float]) -> Cost:
    """A spiking actor; ``rates``: share of steps with a spike of the input population and of each hidden layer.

    Args:
        config: the resolved configuration (``actor`` of kind spiking, ``encoder``).
        observation_size: N.
        action_size: M.
        rates: ``[1 + hidden layers]``.
    """
    actor, encoder = config["actor"], config["encoder"]
    steps, hidden = int(actor["time_steps"]), [int(width) for width in actor["hidden_sizes"]]
    inputs, outputs = observation_size * int(encoder["population_size"]), action_size * int(actor["output_population"])
    sizes = [inputs, *hidden, outputs]
    if len(rates) < len(sizes) - 1:
        raise ValueError(f"{len(sizes) - 1} firing rates are needed, found {len(rates)}")
    synaptic = sum(steps * rate * a * b for rate, a, b in zip(rates, sizes, sizes[1:]))
    lateral, radius = actor["lateral"], int(actor["lateral"]["radius"])
    widths = hidden + ([outputs] if actor["dendritic"].get("output_topology") else [])
    neighbours = [
        lateral_connections(width, radius, bool(lateral.get("include_self")) and radius > 0) for width in widths
    ]
    sideways = sum((steps - 1) * rate * n for rate, n in zip(rates[1:], neighbours))
    coding = steps * inputs if encoder["coding"] == "deterministic" else 0
    dendritic, neurons = actor["dendritic"], sum(hidden) + outputs
    # a bias inside the max is added on every branch; the output population has branches only with its own topology
    several = int(dendritic.get("branches", 1)) if dendritic.get("bias") == "branch" else 1
    biases = sum(hidden) * several + outputs * (several if dendritic.get("output_topology") else 1)
    return Cost(
        synaptic,
        sideways,
        float(coding),
        float(steps * biases + action_size),
        2.0 * inputs + 2.0 * steps * neurons + outputs,
        sum(a * b for a, b in pairwise(sizes)),
        sum(neighbours),
    )


def cost_of(config: dict[str, Any], observation_size: int, action_size: int, rates: list[float]) -> Cost | None:
    """The cost of any actor; None where it cannot be known (a user's own class, rates not measured)."""
    kind = config["actor"].get("kind")
    if kind == "mlp":
        return mlp_cost([observation_size, *config["actor"]["hidden_sizes"], action_size])
    if kind != "spiking" or any(rate != rate for rate in rates):
        return None
    if (
        config["actor"]["dendritic"].get("output_topology")
        and int(config["actor"]["lateral"]["radius"]) > 0
        and len(rates) < 4
    ):
        return None  # the output population's own rate is needed for its lateral operations
    return spiking_cost(config, observation_size, action_size, rates)
