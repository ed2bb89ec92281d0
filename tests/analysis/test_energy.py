"""If these fail, the report says that one actor is cheaper than another where the counts say otherwise."""

import math

import pytest

from analysis.data.collected import collect, load
from analysis.energy import PRICES, turning_ratio
from analysis.statistics.operations import NOT_MEASURED, operations_table
from benchmarks.synthetic import write_operations, write_run


def table(study):
    collect(study)
    return operations_table(load(study))


def test_the_ratio_at_which_the_order_turns_makes_both_cost_the_same():
    ratio = turning_ratio(100, 5000, 1000, 300)
    assert 100 * ratio + 5000 == pytest.approx(1000 * ratio + 300)
    assert math.isnan(turning_ratio(100, 200, 1000, 300))  # less of both: cheaper at any price
    assert math.isnan(turning_ratio(100, 200, 100, 200))


def test_counts_ratios_and_energy_by_hand(tmp_path):
    for seed, extra in ((0, -100.0), (1, 100.0)):
        write_operations(write_run(tmp_path / "s", actor="aan", seed=seed), macs=40_000 + extra, acs=0)
        run = write_run(tmp_path / "s", actor="bptsan", seed=seed)
        write_operations(run, macs=1_000 + extra, acs=59_000, updates=2_500, zero_weights=250)
    rows = table(tmp_path / "s").frame.set_index("arm")
    aan, mine = rows.loc["aan"], rows.loc["bptsan"]
    assert (mine["n"], mine["mac_effective"], mine["ac_effective"], mine["mac_dense"]) == (2, 1_000, 59_000, 100_000)
    assert mine["ratio"] == pytest.approx(60_000 / 40_000) and aan["ratio"] == 1
    assert mine["ratio_updates"] == pytest.approx((60_000 + 8 * 2_500) / 40_000)
    assert mine["connection_sparsity"] == pytest.approx(0.25) and mine["kilobytes"] == 400
    assert mine["nanojoule_45nm"] == pytest.approx((1_000 * 4.6 + 59_000 * 0.9) / 1000)
    assert mine["nanojoule_77fJ"] == pytest.approx((1_000 * 3.97 + 59_000 * 0.077) / 1000)
    assert mine["turning_ratio"] == pytest.approx(59_000 / 39_000) and mine["turns"] == "1.5: cheaper above"
    # and so it is: at 45 nm a MAC costs 5.1 ACs
    assert PRICES[0].mac / PRICES[0].ac > 1.5 and mine["nanojoule_45nm"] < aan["nanojoule_45nm"]


def test_what_was_not_counted_is_not_guessed(tmp_path):
    write_run(tmp_path / "s", actor="aan")
    write_operations(write_run(tmp_path / "s", actor="bptsan"), macs=1, acs=1)
    found = table(tmp_path / "s")
    assert found.frame["arm"].tolist() == ["bptsan"] and found.rows()[0][-1] == "no AAN counted"
    write_run(tmp_path / "none", actor="aan")
    assert table(tmp_path / "none").as_dict()["empty"] == NOT_MEASURED


def test_a_damaged_file_is_left_out_and_said(tmp_path):
    run = write_run(tmp_path / "s", actor="aan")
    write_operations(run, macs=10, acs=0)
    (run / "operations.json").write_text(
        (run / "operations.json").read_text().replace('"kind": "MAC"', '"kind": "mac"')
    )
    study = collect(tmp_path / "s")
    assert study.operations.empty and len(study.runs) == 1
    assert "operations.json is damaged (layers.0.kind" in " ".join(study.warnings)
