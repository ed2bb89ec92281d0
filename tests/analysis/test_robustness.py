"""If these fail, a report says of an actor's robustness what its robustness.csv files do not."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from analysis.data.collected import collect, load
from analysis.figures import build
from analysis.references import Scale
from analysis.robustness import summary
from benchmarks.synthetic import write_run

#: Returns of three seeds, undisturbed and under noise.
RETURNS = {0: (1000.0, 400.0), 1: (2000.0, 1700.0), 2: (1500.0, 600.0)}


def write_robustness(run: Path, plain: float, noisy: float) -> Path:
    rows = ["policy,disturbance,severity,episode,return,length"]
    for disturbance, severity, mean in (("none", "0", plain), ("weight noise", "0.05", noisy)):
        rows += [f"final,{disturbance},{severity},{k},{mean + shift},100" for k, shift in enumerate((-50.0, 50.0))]
    path = run / "robustness.csv"
    path.write_text("\n".join(rows) + "\n")
    return path


def frame() -> pd.DataFrame:
    rows = [
        ("popsan", seed, name, severity, value)
        for seed, values in RETURNS.items()
        for name, severity, value in zip(("none", "weight noise"), (0.0, 0.05), values)
    ]
    return pd.DataFrame(rows, columns=["arm", "seed", "disturbance", "severity", "return"])


def test_the_change_is_the_mean_difference_over_seeds_with_its_t_interval() -> None:
    table = summary(frame(), Scale(zero=0.0, hundred=2000.0)).set_index("disturbance")
    changes = np.array([noisy - plain for plain, noisy in RETURNS.values()]) / 20
    found = table.loc["weight noise"]
    assert found["n"] == 3 and found["change"] == pytest.approx(changes.mean())
    interval = stats.t.interval(0.95, 2, changes.mean(), stats.sem(changes))
    assert (found["change_low"], found["change_high"]) == pytest.approx(interval)
    assert table.loc["none", "change"] == 0 and table.loc["none", "score"] == pytest.approx(75)


def test_without_a_scale_returns_stay_and_one_seed_has_no_interval() -> None:
    table = summary(frame().query("seed == 1"), None).set_index("disturbance")
    assert table.loc["weight noise", "change"] == -300 and np.isnan(table.loc["weight noise", "change_low"])


def test_the_report_draws_what_was_collected(tmp_path: Path) -> None:
    folder = tmp_path / "s"
    for seed, values in RETURNS.items():
        write_robustness(write_run(folder, actor="popsan", seed=seed), *values)
    collected, loaded = collect(folder), load(folder)
    pd.testing.assert_frame_equal(collected.robustness, loaded.robustness, check_dtype=False)
    drawings = {drawing.name: drawing for drawing in build(loaded, folder)}
    (name,) = [name for name in drawings if name.startswith("robustness-")]
    assert (folder / "figures" / f"{name}.png").is_file() and "weight noise 0.05" in drawings[name].alt


def test_a_damaged_file_is_left_out_with_a_warning_and_the_run_counts(tmp_path: Path) -> None:
    path = write_robustness(write_run(tmp_path / "s", actor="popsan"), 1.0, 2.0)
    path.write_text(path.read_text().replace("none", "some"))
    study = collect(tmp_path / "s")
    assert study.robustness.empty and len(study.runs) == 1
    assert "robustness.csv is damaged (the plain evaluation is not in it)" in " ".join(study.warnings)
    assert not (tmp_path / "s" / "collected" / "robustness.csv").exists()
