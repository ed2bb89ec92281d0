"""If these fail, a figure says of an actor's robustness what its robustness.csv files do not."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from analysis import robustness
from analysis.data.errors import InputError
from analysis.references import references

#: Mean returns of three seeds, undisturbed and under noise.
RETURNS = {0: (1000.0, 400.0), 1: (2000.0, 1700.0), 2: (1500.0, 600.0)}


def study(folder: Path, env: str = "hopper") -> Path:
    for seed, (plain, noisy) in RETURNS.items():
        run = folder / "runs" / "td3" / env / "popsan" / "poisson" / f"seed_{seed}"
        run.mkdir(parents=True)
        rows = ["policy,disturbance,severity,episode,return,length"]
        for disturbance, severity, mean in (("none", "0", plain), ("weight noise", "0.05", noisy)):
            rows += [f"final,{disturbance},{severity},{k},{mean + shift},100" for k, shift in enumerate((-50.0, 50.0))]
        (run / "robustness.csv").write_text("\n".join(rows) + "\n")
    return folder


def test_the_change_is_the_mean_difference_over_seeds_with_its_t_interval(tmp_path: Path) -> None:
    table = robustness.summary(robustness.read(study(tmp_path))).set_index("disturbance")
    points = 100 / (references()["aan_reference"]["td3"]["hopper"] - references()["random_policy"]["hopper"]["mean"])
    changes = np.array([noisy - plain for plain, noisy in RETURNS.values()]) * points
    found = table.loc["weight noise"]
    assert found["n"] == 3 and found["change"] == pytest.approx(changes.mean())
    interval = stats.t.interval(0.95, 2, changes.mean(), stats.sem(changes))
    assert (found["change_low"], found["change_high"]) == pytest.approx(interval)
    assert table.loc["none", "change"] == 0


def test_a_task_without_references_keeps_its_returns(tmp_path: Path) -> None:
    table = robustness.summary(robustness.read(study(tmp_path, env="my_task"))).set_index("disturbance")
    assert table.loc["none", "score"] == pytest.approx(1500.0) and not table["normalised"].any()


def test_the_command_draws_a_figure_and_its_numbers_the_same_each_time(tmp_path: Path) -> None:
    folder = study(tmp_path)
    assert robustness.main([str(folder)]) == 0
    names = [f"robustness-td3-hopper.{kind}" for kind in ("csv", "pdf", "png")]
    first = [(folder / "figures" / name).read_bytes() for name in names]
    assert robustness.main([str(folder)]) == 0
    assert first == [(folder / "figures" / name).read_bytes() for name in names]


def test_a_study_without_the_file_and_a_damaged_file_are_one_sentence(tmp_path: Path) -> None:
    (tmp_path / "empty" / "runs").mkdir(parents=True)
    with pytest.raises(InputError, match="--robustness writes it"):
        robustness.read(tmp_path / "empty")
    folder = study(tmp_path / "damaged")
    path = next(folder.rglob("robustness.csv"))
    path.write_text(path.read_text().replace("none", "some"))
    with pytest.raises(InputError, match="with the plain evaluation in it"):
        robustness.read(folder)
