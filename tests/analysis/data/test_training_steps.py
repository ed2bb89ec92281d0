"""If these fail, runs of unequal length are compared, or finished runs vanish because of one longer run."""

import numpy as np

from analysis.data.study import read_study
from benchmarks.synthetic import write_grid, write_run


def counted(study):
    return {(r.arm, r.seed): r.counts_as for r in study.runs.itertuples()}


def test_one_longer_run_does_not_demote_the_finished_ones(tmp_path):
    write_grid(tmp_path / "s", actors=("popsan",), seeds=3)
    write_run(tmp_path / "s", total_steps=200_000)
    study = read_study(tmp_path / "s")
    assert set(study.runs["training_steps"]) == {100_000}
    assert counted(study)["bptsan", 0] == "unfinished"
    assert [counted(study)["popsan", seed] for seed in range(3)] == ["finished"] * 3
    (note,) = study.warnings
    assert "bptsan" in note and "200,000" in note and "100,000" in note


def test_a_longer_run_that_is_not_finished_and_a_longer_variant_change_nothing(tmp_path):
    write_run(tmp_path / "s", actor="popsan")
    write_run(tmp_path / "s", status="running", total_steps=1_000_000, stop=20_000)
    for seed in range(3):
        write_run(tmp_path / "s", seed=seed, label="mine", total_steps=300_000, noise=1.0)
    study = read_study(tmp_path / "s")
    assert set(study.runs["training_steps"]) == {100_000} and counted(study)["popsan", 0] == "finished"
    assert all("/mine/" in note for note in study.warnings)


def test_evaluations_missing_at_the_end_are_noted_by_run(tmp_path):
    run = write_run(tmp_path / "s", interval=5_000, curve=np.full(21, 500.0))
    write_run(tmp_path / "s", seed=1, interval=5_000)
    path = run / "evaluations.csv"
    path.write_text("".join(line for line in path.read_text().splitlines(True) if not line.startswith("95000,")))
    (note,) = read_study(tmp_path / "s").warnings
    assert "seed_0: 1 of the 2 evaluations in the last 10% of its steps are missing (step 95,000)" in note
