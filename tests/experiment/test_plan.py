"""If these fail, a user is told the wrong price, or the first key of a sweep file doesn't vary slowest."""

import dataclasses
import json
import sys

import pytest
from hydra.core.override_parser.overrides_parser import OverridesParser

from src.config.schema import ENGINE
from src.experiment import cost as costs
from src.experiment.ownership import acquire
from tests.experiment.command import run
from tests.experiment.runs import ROOT, changed, run_of, smoke

sys.path.append(str(ROOT / "src" / "plugins"))
from hydra_plugins.testbed.sweeper import GridSweeper


def jobs(*overrides):
    return GridSweeper.split_arguments(OverridesParser.create().parse_overrides(list(overrides)), None)[0]


def test_the_first_override_varies_slowest():
    grid = jobs("seed=range(2)", "actor=aan,popsan")
    assert grid == [[f"seed={seed}", f"actor={actor}"] for seed in (0, 1) for actor in ("aan", "popsan")]


def test_the_command_line_wins_over_a_sweep_file_in_its_place():
    assert jobs("seed=range(9)", "actor=aan,popsan", "seed=7") == [["seed=7", "actor=aan"], ["seed=7", "actor=popsan"]]


def test_disk_is_that_of_the_replay():
    hopper = run_of("protocol.total_steps=100_000").config
    estimate = costs.cost([(hopper, 0)] * 3, jobs_at_once=2)
    assert estimate.peak_bytes == 2 * 100_000 * (2 * 11 + 3 + 2) * 4 and estimate.kept_bytes == 0
    kept = costs.cost([(dataclasses.replace(hopper, keep_replay=True), 0)] * 3, jobs_at_once=2)
    assert kept.kept_bytes == 3 * 100_000 * (2 * 11 + 3 + 2) * 4


@pytest.mark.parametrize(
    ("env", "size"), [("ant", 111), ("ant_zero_contact", 111), ("ant_no_contact", 27), ("hopper", 11)]
)
def test_sizes_are_those_that_gymnasium_gives(env, size):
    import gymnasium

    config = run_of(f"env={env}").config.env
    made = gymnasium.make(config.id, **config.kwargs)
    assert made.observation_space.shape[0] + config.zero_padding == size
    assert costs._sizes(json.dumps(dataclasses.asdict(config))) == (size, made.action_space.shape[0])


def test_hours_shrink_with_what_is_done_and_follow_what_was_measured(tmp_path):
    config = changed(run_of(), results_dir=str(tmp_path)).config
    whole, half = costs.cost([(config, 0)], 1), costs.cost([(config, 500_000)], 1)
    assert half.core_hours == pytest.approx(whole.core_hours / 2) and not whole.measured
    with acquire(smoke(tmp_path)) as (run, _):
        run.update_manifest(step=2000, wall_time_seconds=2.0, status="complete")
    here = run.manifest.processor
    for other in ({"engine": ENGINE - 1}, {"engine": ENGINE, "processor": "another"}):
        run.update_manifest(**other)
        costs._measured_rates.cache_clear()
        assert costs.cost([(config, 0)], 1) == whole
    run.update_manifest(processor=here)
    costs._measured_rates.cache_clear()
    measured = costs.cost([(config, 0)], 1)
    assert measured.measured and measured.core_hours == pytest.approx(1_000_000 / 1000 / 3600)


def test_a_grid_over_a_key_that_changes_nothing_has_each_run_once(tmp_path):
    grid = ("actor=aan,bptsan", "encoder.population_size=10,20", "protocol=smoke", "dry_run=true")
    done = run(tmp_path, "-m", *grid)
    assert done.code == 0 and "3 runs in" in done.out, done
    twice = run(tmp_path, "-m", "actor=aan", "seed=1,1", "protocol=smoke", "dry_run=true")
    assert twice.code == 2 and "the grid has this run twice" in twice.err
