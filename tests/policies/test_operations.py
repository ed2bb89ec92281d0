"""If these fail, the operations in ``operations.json`` are not NeuroBench's, and an energy ratio favours one side."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
import torch
from torch import Tensor, nn

from src.actors.actor import Actor
from src.actors.build import build_actor
from src.actors.population_encoder import PopulationEncoder
from src.experiment.run_directory import RunDirectory
from src.policies.operations import OperationCounter, count_again, fan_out, kind_of, synapses, write_operations
from src.policies.trace import Connections, Neurons, NotTraceable, Trace, trace
from src.streams import Streams
from tests.actors.configuration import configuration
from tests.helpers import tiny
from tests.training.test_session import run

RAW = torch.zeros(1, 1)
RIVALS = ["popdan", "mdcsan", "ilcsan", "lif_san"]


def counted(*traces: Trace, actor: Actor | None = None) -> Any:
    counter = OperationCounter()
    for each in traces:
        counter.add(each)
    return counter.operations(actor or Actor(), episodes=1)


def built(actor: str, encoder: str = "deterministic", **overrides: Any) -> Actor:
    config = configuration(actor, "task" if actor in ("aan", "popdan", "mdcsan") else encoder, **overrides)
    return build_actor(config, 3, 2, Streams(0))


def test_a_layer_of_spikes_by_hand() -> None:
    """Inputs (1, 0, 1) then (0, 0, 1); weights 2 x 3, one of them 0: 1 + 2 pairs, then 2, of 6 a step."""
    weight = torch.tensor([[0.0, 1.0, 2.0], [3.0, 4.0, 5.0]])
    inputs = torch.tensor([[[1.0, 0.0, 1.0]], [[0.0, 0.0, 1.0]]])
    (layer,) = counted(Trace(RAW, [Connections("a", inputs, weight)], [])).layers
    assert (layer.kind, layer.dense, layer.effective) == ("AC", 12.0, 5.0)
    assert (layer.weights, layer.zero_weights) == (6, 1)


def test_counts_are_averages_over_the_decisions_of_all_calls() -> None:
    weight = torch.ones(1, 1)
    two = Trace(torch.zeros(2, 1), [Connections("a", torch.ones(1, 2, 1), weight)], [])
    none = Trace(RAW, [Connections("a", torch.zeros(1, 1, 1), weight)], [])
    found = counted(two, none)
    assert found.decisions == 3 and found.layers[0].dense == 1.0
    assert found.layers[0].effective == pytest.approx(2 / 3)


def test_the_kind_is_decided_by_the_values_of_a_call() -> None:
    assert kind_of(torch.tensor([-1.0, 0.0, 1.0])) == "AC"
    assert kind_of(torch.tensor([0.0, 0.2])) == "MAC" and kind_of(torch.tensor([2.0])) == "MAC"
    weight = torch.tensor([[1.0, 0.0]])
    calls = [Trace(RAW, [Connections("a", torch.full((1, 1, 2), x), weight)], []) for x in (1.0, 0.5, 1.0)]
    layers = counted(*calls).layers
    assert [(layer.kind, layer.dense * 3, layer.weights) for layer in layers] == [("AC", 4, 2), ("MAC", 2, 0)]


def test_a_lateral_layer_has_no_neighbours_beyond_its_ends() -> None:
    """Three neurons, offsets -1 and 1: the first reaches neuron 2, the second 1 and 3, the third 2."""
    connections = Connections("a", torch.ones(1, 1, 3), torch.ones(2, 3), offsets=(-1, 1))
    assert fan_out(connections).tolist() == [1, 2, 1] and synapses(connections) == 4
    connections.weight[0, 1] = 0.0  # neuron 2 no longer hears neuron 1
    assert fan_out(connections).tolist() == [0, 2, 1] and synapses(connections) == 4


def test_a_lateral_layer_wider_than_its_neurons() -> None:
    connections = Connections("a", torch.ones(1, 1, 2), torch.ones(6, 2), offsets=(-3, -2, -1, 1, 2, 3))
    assert fan_out(connections).tolist() == [1, 1] and synapses(connections) == 2


def test_a_decoder_has_one_synapse_for_each_neuron() -> None:
    rates = torch.tensor([[[0.2, 0.0, 1.0, 0.4]]])
    (layer,) = counted(Trace(RAW, [Connections("d", rates, torch.ones(2, 2), grouped=True)], [])).layers
    assert (layer.kind, layer.dense, layer.effective, layer.weights) == ("MAC", 4.0, 3.0, 4)


def test_an_update_is_a_change_of_the_kept_potential_and_the_first_step_changes_all() -> None:
    """Neuron 1: 0.3 to 0.3, none; neuron 2 fires (kept 0), then 0.5: one; neuron 3 fires twice (kept 0, 0): none."""
    potentials = torch.tensor([[[0.3, 0.9, 0.8]], [[0.3, 0.5, 0.7]]])
    spikes = torch.tensor([[[0.0, 1.0, 1.0]], [[0.0, 0.0, 1.0]]])
    found = counted(Trace(RAW, [], [Neurons("a", spikes, potentials)]))
    assert found.neuron_updates == 3 + 1 and found.neurons == 3
    assert found.activation_sparsity == pytest.approx(3 / 6)


def test_the_aan_gets_the_sparsity_of_its_relus() -> None:
    actor = built("aan", actor__hidden_sizes=[2, 2])
    with torch.no_grad():
        for parameter in actor.parameters():
            parameter.zero_()
        actor.hidden.weights[0][0] = torch.tensor([[1.0, -1.0], [0.0, 0.0], [2.0, 1.0]])  # [in, out]
        actor.hidden.weights[1][0] = torch.tensor([[1.0, 1.0], [1.0, 0.0]])
        actor.output.weights[0][0] = 1.0
    found = counted(trace(actor, torch.tensor([[1.0, 7.0, 0.0]])), actor=actor)
    # layer 1 hears (1, 7, 0): 2 synapses of the 1, none of the 7; it gives (1, 0). Layer 2 hears the 1, gives (1, 1).
    assert [layer.effective for layer in found.layers] == [2.0, 2.0, 4.0]
    assert [layer.dense for layer in found.layers] == [6.0, 4.0, 4.0]
    assert [layer.kind for layer in found.layers] == ["MAC", "AC", "AC"]  # a ReLU's 1 is a 1
    assert found.activation_sparsity == pytest.approx(1 / 4)
    assert (found.neuron_updates, found.neurons, found.encoder_exponentials) == (0.0, 4, 0.0)
    assert found.footprint_bytes == 4 * (6 + 2 + 4 + 2 + 4 + 2)


@pytest.mark.parametrize("actor", ["popsan", "bptsan", "bptsan_wo_ndt", "bptsan_wo_li", "aan", *RIVALS])
@pytest.mark.parametrize("encoder", ["deterministic", "poisson"])
def test_what_is_traced_is_what_the_actor_computes(actor: str, encoder: str) -> None:
    network = built(actor, encoder, actor__hidden_sizes=[32, 32])
    observation = torch.randn(64, 3)
    seen = trace(network, observation, torch.Generator().manual_seed(1))
    with torch.no_grad():
        expected = network(observation, torch.Generator().manual_seed(1))
    torch.testing.assert_close(seen.raw, expected)


def test_a_dendritic_layer_counts_its_unmasked_synapses_once() -> None:
    plain, dendritic = built("popsan"), built("bptsan_wo_li")
    sizes = [
        [layer.weights for layer in counted(trace(a, torch.zeros(1, 3)), actor=a).layers] for a in (plain, dendritic)
    ]
    assert sizes[0] == sizes[1] == [30 * 256, 256 * 256, 256 * 20, 20]


def test_analog_input_counts_macs_at_every_step_and_spikes_accumulates() -> None:
    actor = built("mdcsan", actor__hidden_sizes=[7, 5])
    layers = {layer.name: layer for layer in counted(trace(actor, torch.randn(4, 3)), actor=actor).layers}
    first, second = layers["layer1"], layers["layer2"]
    assert (first.kind, first.dense, first.weights) == ("MAC", 5 * 30 * 7, 30 * 7)
    assert first.effective > 0.5 * first.dense and (second.kind, second.dense) == ("AC", 5 * 7 * 5)


def test_popdan_counts_macs_of_its_strength_and_of_its_relus() -> None:
    actor = built("popdan", actor__hidden_sizes=[7, 5])
    found = counted(trace(actor, torch.randn(4, 3)), actor=actor)
    assert [(layer.kind, layer.dense) for layer in found.layers] == [
        ("MAC", 30 * 7),
        ("MAC", 7 * 5),
        ("MAC", 5 * 20),
        ("MAC", 20),
    ]
    assert (found.encoder_exponentials, found.neurons, found.neuron_updates) == (30, 7 + 5 + 20, 0)


@pytest.mark.parametrize("connected,number", [("all", 2 * 100), ("no_self", 2 * 90), ("self_only", 2 * 10)])
def test_connections_of_the_output_population_and_a_readout_of_spikes(connected: str, number: int) -> None:
    actor = built("ilcsan", actor__hidden_sizes=[7, 5], actor__output_lateral=connected)
    seen = trace(actor, torch.randn(1, 3))
    layers = {layer.name: layer for layer in counted(seen, actor=actor).layers}
    within, decoder = layers["layer3.output_lateral"], layers["decoder"]
    assert (within.kind, within.dense, within.weights, within.zero_weights) == ("AC", 5 * number, number, 0)
    spikes_but_the_last = float(seen.neurons[-1].activations[:-1].sum())
    assert within.effective == spikes_but_the_last * number / 20
    assert (decoder.kind, decoder.dense) == ("AC", 5 * 20)  # a step's spikes, not rates


def test_encoder_and_random_numbers_are_listed() -> None:
    actor = built("popsan", "poisson")
    found = counted(trace(actor, torch.zeros(1, 3), torch.Generator()), actor=actor)
    assert found.encoder_exponentials == 30 and found.random_numbers == 30 * 5
    assert counted(trace(built("popsan"), torch.zeros(1, 3)), actor=built("popsan")).random_numbers == 0


class Own(Actor):
    """An actor of a user's own, its spikes computed outside any layer."""

    def __init__(self, encoder: PopulationEncoder | None = None) -> None:
        super().__init__()
        self.first, self.second = nn.Linear(3, 4, bias=False), nn.Linear(4, 2)
        nn.init.constant_(self.first.weight, 1.0)

    def forward(self, observation: Tensor, generator: torch.Generator | None = None) -> Tensor:
        hidden = torch.relu(self.first(observation) - torch.tensor([0.0, 0.0, 0.0, 9.0]))
        return self.second(hidden)


def test_an_actor_of_ones_own_is_counted_by_its_linear_layers() -> None:
    actor = Own()
    found = counted(trace(actor, torch.tensor([[0.5, 0.0, 0.5]])), actor=actor)
    assert [(layer.name, layer.effective) for layer in found.layers] == [("first", 8.0), ("second", 6.0)]
    assert found.activation_sparsity == pytest.approx(1 / 4) and found.neurons == 4
    assert not any(module._forward_hooks for module in actor.modules())


def test_an_actor_without_linear_layers_is_not_counted() -> None:
    class Opaque(Actor):
        def forward(self, observation: Tensor, generator: torch.Generator | None = None) -> Tensor:
            return observation[:, :2]

    with pytest.raises(NotTraceable, match=r"Opaque calls no nn\.Linear"):
        trace(Opaque(), torch.zeros(1, 3))


@pytest.mark.parametrize("actor,algo", [("bptsan", "td3"), ("aan", "sac")])
def test_a_finished_run_leaves_its_operations_and_the_command_counts_the_same(
    tmp_path: Path, actor: str, algo: str
) -> None:
    path = run(tiny(tmp_path, actor=actor, algo=algo))[1]
    left = (path / "operations.json").read_bytes()
    content = json.loads(left)
    lengths = [int(row.split(",")[3]) for row in (path / "evaluations.csv").read_text().splitlines()[-2:]]
    assert content["decisions"] == sum(lengths) and content["episodes"] == 2
    assert all(
        0 < layer["effective"] <= layer["dense"] for layer in content["layers"] if "lateral" not in layer["name"]
    )
    (path / "operations.json").unlink()
    write_operations(path, count_again(path / "policy.pt"))
    assert (path / "operations.json").read_bytes() == left


def test_a_failure_to_count_is_a_note_and_the_run_is_complete(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise RuntimeError("no counting today")

    monkeypatch.setattr("src.training.session.count_operations", fail)
    outcome, path = run(tiny(tmp_path, actor="aan"))
    assert outcome.status == "complete"
    assert "operations were not counted: no counting today" in RunDirectory(path).manifest.notes
