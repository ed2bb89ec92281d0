"""If these fail, the cost table compares the wrong operations."""

import pytest

from analysis.data.collected import collect, load
from analysis.energy import ACCUMULATE_PICOJOULE, MAC_PICOJOULE, cost_of, lateral_connections, mlp_cost
from analysis.statistics.cost import costs, energy_table
from tests.analysis.synthetic import configuration, write_run


def test_lateral_connections_by_hand():
    assert lateral_connections(5, 2) == 14  # 2 + 3 + 4 + 3 + 2
    assert lateral_connections(5, 0) == 0
    assert lateral_connections(3, 1, include_self=True) == 4 + 3
    assert lateral_connections(256, 2) == 1018


def test_mlp_by_hand():
    cost = mlp_cost([11, 256, 256, 3])
    assert cost.macs == 11 * 256 + 256 * 256 + 256 * 3 == cost.connections
    assert cost.bias_accumulates == 256 + 256 + 3
    assert cost.nanojoule == pytest.approx((cost.macs * MAC_PICOJOULE + 515 * ACCUMULATE_PICOJOULE) / 1000)


def test_spiking_actor_by_hand():
    config = configuration("td3", "hopper", "bptsan")
    config["actor"]["hidden_sizes"] = [4, 4]
    cost = cost_of(config, 1, 1, [0.2, 0.5, 0.25, 0.9])
    # T=5; N*J=10 -> 4 -> 4 -> 10
    assert cost.synaptic_operations == pytest.approx(5 * (0.2 * 10 * 4 + 0.5 * 4 * 4 + 0.25 * 4 * 10))
    neighbours = 10  # 4 in a line, radius 2: 2 + 3 + 3 + 2
    assert cost.lateral_operations == pytest.approx(
        4 * neighbours * (0.5 + 0.25)
    )  # T - 1 steps have a step before them
    assert cost.macs == 2 * 10 + 10 + 2 * 5 * (4 + 4 + 10)  # encoder, decoder, two decays of 18 neurons at 5 steps
    assert cost.bias_accumulates == 5 * (4 + 4 + 10) + 1
    assert cost.encoder_accumulates == 0  # poisson
    assert cost.connections == 40 + 16 + 40 and cost.lateral_connections == 20
    accumulates = cost.synaptic_operations + cost.lateral_operations + cost.bias_accumulates
    assert cost.nanojoule == pytest.approx((accumulates * ACCUMULATE_PICOJOULE + cost.macs * MAC_PICOJOULE) / 1000)
    config["encoder"]["coding"] = "deterministic"
    assert cost_of(config, 1, 1, [0.2, 0.5, 0.25, 0.9]).encoder_accumulates == 50


def test_a_bias_on_every_branch_is_added_on_every_branch():
    config = configuration("td3", "hopper", "bptsan")
    config["actor"]["dendritic"]["bias"] = "branch"
    cost = cost_of(config, 11, 3, [0.2, 0.3, 0.3, 0.3])
    assert cost.bias_accumulates == 5 * (2 * 512 + 30) + 3


def test_dendrites_count_each_synapse_once_and_lateral_weights_are_the_only_difference():
    rates = [0.2, 0.3, 0.3, 0.3]
    costs_ = {
        name: cost_of(configuration("td3", "hopper", name), 11, 3, rates)
        for name in ("popsan", "bptsan", "bptsan_wo_li")
    }
    assert costs_["bptsan_wo_li"] == costs_["popsan"]
    assert costs_["bptsan"].connections == costs_["popsan"].connections
    assert costs_["bptsan"].lateral_connections == 2 * 1018


def test_a_users_own_actor_or_unmeasured_rates_are_not_guessed():
    config = configuration("td3", "hopper", "bptsan")
    assert cost_of(config, 11, 3, [0.2, float("nan"), 0.1, 0.1]) is None
    assert cost_of(config | {"actor": {"kind": "custom"}}, 11, 3, [0.2]) is None


def test_the_table_takes_late_rates_of_finished_runs(tmp_path):
    write_run(tmp_path / "s", actor="aan")
    write_run(tmp_path / "s", actor="bptsan")
    collect(tmp_path / "s")
    study = load(tmp_path / "s")
    cost = costs(study)["td3", "hopper", "bptsan"]
    # synthetic rates end at 0.2 (input), 0.4, 0.35; the last 10% is the last interval
    assert cost.synaptic_operations == pytest.approx(
        5 * (0.2 * 110 * 256 + 0.4 * 256 * 256 + 0.35 * 256 * 30), rel=1e-4
    )
    table = energy_table(study)
    assert table.frame.set_index("arm").loc["aan", "of_aan"] == 1
    assert "4.6 pJ" in table.caption and "0.9 pJ" in table.caption
