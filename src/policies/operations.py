"""Operations of one decision, counted as NeuroBench does, alike for every actor.

Over the decisions of evaluation episodes played by a trained policy:

- effective synaptic operations: pairs of a non-zero input and a non-zero weight; dense: all pairs. Both are summed over
  the time steps of a decision. Biases are not counted. A call of a layer whose inputs are all -1, 0 or 1 counts
  accumulates (AC), any other call multiply-accumulates (MAC).
- neuron updates: neurons x steps whose membrane potential, as it is kept from one step to the next (after the reset),
  changes; the first step changes all. A membrane readout's M integrators never fire and are not counted; analog input
  is, at every step.
- activation sparsity: zeros among all outputs of all neuron layers, a ReLU's as a spiking neuron's.

Source: Yik et al., NeuroBench, Nature Communications 16, 1545 (2025), and its `neurobench` package.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Literal

import torch
from torch import Tensor

from src.actors.actor import Actor
from src.actors.population_encoder import PopulationEncoder
from src.algorithms.networks import DeterministicPolicy
from src.experiment.files import replace_file
from src.policies.trace import Connections, Trace, trace
from src.streams import Streams
from src.training.evaluation import Evaluator
from src.training.normalization import Normalizer
from src.training.policy_file import load_policy

OPERATIONS_FILE = "operations.json"
Kind = Literal["MAC", "AC"]


@dataclass(frozen=True)
class LayerOperations:
    """A connection layer; ``dense`` and ``effective`` are operations per decision, ``weights`` synapses."""

    name: str
    kind: Kind
    dense: float
    effective: float
    weights: int
    zero_weights: int


@dataclass(frozen=True)
class Operations:
    """The content of ``operations.json`` (docs/run-directory.md); floats are averages per decision."""

    decisions: int
    episodes: int
    layers: list[LayerOperations]
    neuron_updates: float
    neurons: int
    encoder_exponentials: float
    random_numbers: float
    activation_sparsity: float
    footprint_bytes: int


def fan_out(connections: Connections) -> Tensor:
    """Non-zero weights behind each input, ``[inputs]``, int64. Beyond a layer's ends there are no neighbours."""
    nonzero = connections.weight != 0
    if connections.grouped:
        return nonzero.flatten().long()
    if connections.exists is not None:
        return nonzero.sum(1).flatten()
    return _lateral_sum(nonzero, connections.offsets) if connections.offsets else nonzero.sum(0)


def synapses(connections: Connections) -> int:
    """How many weights there are; of a dendritic layer each synapse once, of a shared lateral weight one a neuron."""
    all_weights = torch.ones_like(connections.weight) if connections.exists is None else connections.exists
    return int(fan_out(connections._replace(weight=all_weights)).sum())


def _lateral_sum(marked: Tensor, offsets: tuple[int, ...]) -> Tensor:
    """For each neuron k the marked weights ``w'_jk``: of row (offset k - j), column j, ``[K, n] -> [n]``."""
    neurons = marked.shape[1]
    total = torch.zeros(neurons, dtype=torch.int64, device=marked.device)
    for row, offset in zip(marked, offsets, strict=True):
        start, end = max(0, -offset), min(neurons, neurons - offset)  # of j
        if start < end:
            total[start + offset : end + offset] += row[start:end]
    return total


def kind_of(inputs: Tensor) -> Kind:
    """AC where all inputs are -1, 0 or 1, else MAC."""
    return "AC" if bool(((inputs == 0) | (inputs.abs() == 1)).all()) else "MAC"


class OperationCounter:
    """Sums over traces. The weights must not change in between."""

    def __init__(self) -> None:
        self.decisions = 0
        self._weights: dict[str, tuple[Tensor, int]] = {}  # of each layer: fan-out, number of synapses
        self._dense: dict[tuple[str, Kind], int] = {}
        self._effective: dict[tuple[str, Kind], int] = {}
        self._neurons: dict[str, int] = {}
        self._updates = self._activations = self._zeros = 0

    def add(self, seen: Trace) -> None:
        """Count a pass of one decision for each of its B observations."""
        self.decisions += len(seen.raw)
        for connections in seen.connections:
            self._add_connections(connections)
        for name, activations, potentials in seen.neurons:
            self._neurons[name] = activations.shape[-1]
            self._activations += activations.numel()
            self._zeros += int((activations == 0).sum())
            if potentials is not None:
                kept = potentials * (1 - activations)
                self._updates += kept[0].numel() + int((kept[1:] != kept[:-1]).sum())

    def _add_connections(self, connections: Connections) -> None:
        name, inputs = connections.name, connections.inputs
        if name not in self._weights:
            self._weights[name] = fan_out(connections), synapses(connections)
        reached, number = self._weights[name]
        key = name, kind_of(inputs)
        nonzero = (inputs != 0).sum(dim=(0, 1))
        calls = inputs.shape[0] * inputs.shape[1]
        self._dense[key] = self._dense.get(key, 0) + calls * number
        self._effective[key] = self._effective.get(key, 0) + int((nonzero * reached).sum())

    def operations(self, actor: Actor, episodes: int) -> Operations:
        """The averages; a layer that counted both kinds has two entries, the weights in the first."""
        layers: list[LayerOperations] = []
        for (name, kind), dense in self._dense.items():
            reached, number = self._weights[name]
            weights = 0 if any(layer.name == name for layer in layers) else number
            zero_weights = weights - int(reached.sum()) if weights else 0
            effective = self._effective[name, kind] / self.decisions
            layers.append(LayerOperations(name, kind, dense / self.decisions, effective, weights, zero_weights))
        encoders = [module for module in actor.modules() if isinstance(module, PopulationEncoder)]
        return Operations(
            decisions=self.decisions,
            episodes=episodes,
            layers=layers,
            neuron_updates=self._updates / self.decisions,
            neurons=sum(self._neurons.values()),
            encoder_exponentials=float(sum(encoder.size for encoder in encoders)),
            random_numbers=float(sum(e.size * e.time_steps for e in encoders if e.coding == "poisson")),
            activation_sparsity=self._zeros / self._activations if self._activations else 0.0,
            footprint_bytes=sum(x.numel() * x.element_size() for x in (*actor.parameters(), *actor.buffers())),
        )


def count_operations(
    policy: DeterministicPolicy, normalizer: Normalizer, evaluator: Evaluator, step: int, device: str = "cpu"
) -> Operations:
    """Play the evaluation episodes of ``step`` and count every decision.

    Raises:
        NotTraceable: see :func:`src.policies.trace.trace`.
    """
    counter = OperationCounter()

    def act(observation: Tensor, generator: torch.Generator) -> Tensor:
        seen = trace(policy.actor, normalizer.normalize(observation).to(device), generator)
        counter.add(seen)
        return torch.tanh(seen.raw) * policy.action_limit

    episodes = evaluator.evaluate(act, step)
    return counter.operations(policy.actor, len(episodes))


def count_again(path: Path) -> Operations:
    """The operations of a final policy over the episodes of its run's last evaluation.

    Raises:
        NotTraceable: see :func:`src.policies.trace.trace`.
    """
    trained = load_policy(path)
    config = trained.config
    step = config.protocol.total_steps if trained.record is None else trained.record.step
    evaluator = Evaluator(config.env, config.protocol.evaluation_episodes, Streams(config.seed))
    return count_operations(trained.policy, trained.normalizer, evaluator, step)


def write_operations(folder: Path, operations: Operations) -> Path:
    """Replace ``operations.json`` of a run directory."""
    path = folder / OPERATIONS_FILE
    replace_file(path, (json.dumps(asdict(operations), indent=1) + "\n").encode())
    return path
