"""If these fail, a swept key is drawn against the wrong values, or a run of another length passes for a short one."""

import pandas as pd
import pytest

from analysis.__main__ import main
from benchmarks.synthetic import write_run


def figures(study, by):
    for stage in (["collect"], ["figures", "--by", by]):
        assert main([stage[0], str(study), *stage[1:]]) == 0
    return study / "figures"


def test_runs_of_unequal_length_stand_side_by_side_when_their_length_is_the_key(tmp_path):
    for steps in (50_000, 100_000):
        for seed in range(2):
            label = "bptsan" if steps == 100_000 else "short"
            manifest = {"actor": "bptsan"}
            write_run(
                tmp_path / "s",
                seed=seed,
                label=label,
                total_steps=steps,
                interval=5_000,
                level=steps / 10,
                manifest=manifest,
            )
    folder = figures(tmp_path / "s", "protocol.total_steps")
    points = pd.read_csv(folder / "sweep-td3-protocol.total_steps.csv")
    assert points["value"].tolist() == [50_000, 100_000] and points["n"].tolist() == [2, 2]
    # each run's own last tenth: at 90% of its training a saturating curve is within 1% of its level
    assert points["mean"].tolist() == pytest.approx([5_000, 10_000], rel=0.01)


def test_a_swept_key_colours_the_curves_beside_the_baselines(tmp_path):
    for seed in range(2):
        write_run(tmp_path / "s", actor="aan", seed=seed)
        for radius in (1, 4):
            changes = {"actor.lateral.radius": radius}
            write_run(tmp_path / "s", seed=seed, label=f"bptsan-lateral.radius={radius}", changes=changes)
    folder = figures(tmp_path / "s", "actor.lateral.radius")
    curves = pd.read_csv(folder / "curves-td3-actor.lateral.radius.csv")
    assert set(curves["value"].dropna()) == {1, 4} and "AAN" in set(curves["line"])


def test_two_keys_give_a_heat_map_of_means(tmp_path):
    for radius in (1, 2):
        for steps, level in ((3, 1000.0), (5, 2000.0)):
            changes = {"actor.lateral.radius": radius, "actor.time_steps": steps}
            write_run(tmp_path / "s", label=f"r{radius}t{steps}", changes=changes, level=level * radius)
    folder = figures(tmp_path / "s", "actor.lateral.radius,actor.time_steps")
    table = pd.read_csv(folder / "heat-td3-actor.lateral.radius-actor.time_steps.csv")
    means = table.set_index(["actor.lateral.radius", "actor.time_steps"])["mean"]
    assert len(means) == 4 and means[(2, 5)] > means[(2, 3)] > means[(1, 3)]
