"""If these fail, a damaged or mixed study gives a wrong number instead of a sentence."""

import json

import numpy as np
import pytest

from analysis.data.cells import cells_of, select
from analysis.data.errors import InputError
from analysis.data.study import read_study
from benchmarks.synthetic import write_grid, write_run


def rewrite(path, change):
    path.write_text(change(path.read_text()))


def test_a_run_as_the_contract_says(tmp_path):
    write_run(tmp_path / "s", seed=3, curve=np.arange(11.0))
    study = read_study(tmp_path / "s")
    assert study.warnings == []
    assert study.runs[["algo", "env", "arm", "seed", "counts_as", "paper"]].values.tolist() == [
        ["td3", "hopper", "bptsan", 3, "finished", True]
    ]
    assert study.evaluations["return"].tolist() == list(range(11))  # the mean of an evaluation's two episodes
    assert study.evaluations["step"].tolist() == list(range(0, 100_001, 10_000))


def test_a_torn_last_line_is_left_out_with_a_note(tmp_path):
    run = write_run(tmp_path / "s", curve=np.full(11, 500.0))
    rewrite(
        run / "evaluations.csv", lambda text: text.rsplit(",", 1)[0][:-3]
    )  # "100000,1,49": a shorter number, no newline
    study = read_study(tmp_path / "s")
    assert any("torn" in note for note in study.warnings)
    assert any("fewer than 2 episodes" in note for note in study.warnings)
    assert any("ends at" in note or "end at step 90,000" in note for note in study.warnings)
    assert study.runs["counts_as"].tolist() == ["unfinished"]
    assert study.evaluations["return"].eq(500).all()


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda text: text.replace("50000,1,", "50000,1\n50000,1,", 1), "fields"),
        (lambda text: text.replace("50000,1,499.0", "50000,1,4x9.0", 1), "no number in column return"),
        (lambda text: text.replace("step,episode", "episode,step", 1), "begins with"),
        (lambda text: text + "50000,1,7.0,1000\n", "twice"),
        (lambda text: text.replace("50000,1,499.0", "50000,1,", 1), "an empty field"),
        (lambda text: text.replace("50000,1,499.0", "50000,1,null", 1), "no number in column return"),
    ],
)
def test_damage_inside_evaluations_leaves_the_run_out(tmp_path, change, reason):
    run = write_run(tmp_path / "s", curve=np.full(11, 500.0))
    write_run(tmp_path / "s", seed=1)
    rewrite(run / "evaluations.csv", change)
    study = read_study(tmp_path / "s")
    assert study.runs["seed"].tolist() == [1]
    assert reason in study.warnings[0] and "seed_0" in study.warnings[0]


@pytest.mark.parametrize(
    "change",
    [lambda text: text.replace("50000,", "50000,x,", 1), lambda text: text.replace("50000,", "x,", 1)],
    ids=["a field too many", "a word"],
)
def test_damage_inside_training_leaves_out_the_training_data_only(tmp_path, change):
    run = write_run(tmp_path / "s")
    rewrite(run / "training.csv", change)
    study = read_study(tmp_path / "s")
    assert study.runs["counts_as"].tolist() == ["finished"] and study.training.empty
    (note,) = study.warnings
    assert "training.csv" in note and "its evaluations count" in note


def test_no_training_file_is_news_only_after_the_first_interval(tmp_path):
    (write_run(tmp_path / "s", status="running", stop=0) / "training.csv").unlink()
    (write_run(tmp_path / "s", seed=1, status="running", stop=20_000) / "training.csv").unlink()
    (note,) = read_study(tmp_path / "s").warnings
    assert "seed_1: training.csv is missing" in note


def test_what_a_manifest_notes_is_passed_on(tmp_path):
    write_run(tmp_path / "s", manifest={"notes": ["resumed on another processor"]})
    assert read_study(tmp_path / "s").warnings == [
        "runs/td3/hopper/bptsan/poisson/seed_0, from its manifest: resumed on another processor"
    ]


def test_a_repeated_row_counts_once(tmp_path):
    run = write_run(tmp_path / "s", curve=np.full(11, 500.0))
    rewrite(run / "evaluations.csv", lambda text: text + text.splitlines()[-1] + "\n")
    study = read_study(tmp_path / "s")
    assert "repeated" in study.warnings[0]
    assert study.evaluations["return"].eq(500).all() and study.runs["counts_as"].tolist() == ["finished"]


@pytest.mark.parametrize(
    ("damage", "reason"),
    [
        (lambda run: (run / "manifest.json").unlink(), "no manifest.json"),
        (lambda run: (run / "manifest.json").write_text("{"), "cannot be read"),
        (lambda run: (run / "manifest.json").write_text("{}"), "lacks status"),
        (lambda run: (run / "config.yaml").unlink(), "no config.yaml"),
        (lambda run: (run / "config.yaml").write_text("a: [1"), "config.yaml cannot be read"),
        (lambda run: rewrite(run / "manifest.json", lambda t: t.replace('"format": 1', '"format": 2')), "format = 2"),
        (lambda run: rewrite(run / "manifest.json", lambda t: t.replace('"complete"', '"happy"')), "status = 'happy'"),
        (lambda run: run.rename(run.with_name("seed_7")), "moved or copied"),
        (lambda run: run.rename(run.with_name("seed_x")), "its path is not"),
    ],
)
def test_a_foreign_or_broken_folder_is_noted_not_read(tmp_path, damage, reason):
    write_run(tmp_path / "s", seed=1)
    damage(write_run(tmp_path / "s"))
    study = read_study(tmp_path / "s")
    assert study.runs["seed"].tolist() == [1]
    assert len(study.warnings) == 1 and reason in study.warnings[0]


def test_an_empty_or_missing_study(tmp_path):
    (tmp_path / "s/runs").mkdir(parents=True)
    assert read_study(tmp_path / "s").warnings == ["There are no runs in s/runs yet."]
    with pytest.raises(InputError, match="There is no folder"):
        read_study(tmp_path / "t")


def test_a_diverged_run_carries_its_last_value_forward_and_is_flagged(tmp_path):
    write_run(tmp_path / "s", status="diverged", stop=30_000, curve=np.array([0.0, 5.0, 9.0, 7.0]))
    study = read_study(tmp_path / "s")
    assert study.evaluations["return"].tolist() == [0, 5, 9, 7] + [7] * 7
    assert study.evaluations["carried"].tolist() == [False] * 4 + [True] * 7
    (cell,) = cells_of(study)
    assert cell.final.tolist() == [7] and cell.diverged.tolist() == [True] and len(cell.without_diverged()) == 0


def test_a_non_finite_return_is_divergence_not_a_number(tmp_path):
    run = write_run(tmp_path / "s", curve=np.full(11, 500.0))
    rewrite(run / "evaluations.csv", lambda text: text.replace("100000,1,499.0", "100000,1,nan"))
    study = read_study(tmp_path / "s")
    assert "non-finite" in study.warnings[0] and study.runs["counts_as"].tolist() == ["diverged"]
    assert study.evaluations["return"].tolist() == [500] * 11  # the last one carried


@pytest.mark.parametrize("status", ["running", "interrupted", "failed"])
def test_unfinished_runs_stand_in_curves_only(tmp_path, status):
    write_run(tmp_path / "s")
    write_run(tmp_path / "s", seed=1, status=status, stop=50_000)
    (cell,) = cells_of(read_study(tmp_path / "s"))
    assert (cell.n, cell.unfinished) == (1, 1)
    from analysis.figures.learning_curves import curve_of

    assert curve_of(cell)["n"].tolist() == [2] * 6 + [1] * 5


def test_unequal_training_is_not_compared(tmp_path):
    write_run(tmp_path / "s", total_steps=200_000)
    write_run(tmp_path / "s", actor="popsan", total_steps=100_000)
    study = read_study(tmp_path / "s")
    assert dict(zip(study.runs["arm"], study.runs["counts_as"])) == {"bptsan": "finished", "popsan": "unfinished"}
    assert "200,000" in study.warnings[0]


def test_variants_never_pass_for_the_papers_actor(tmp_path):
    write_run(tmp_path / "s")
    write_run(tmp_path / "s", label="bptsan-branches=4", changes={"actor.dendritic.branches": 4})
    write_run(
        tmp_path / "s", actor="popsan", changes={"actor.time_steps": 8}
    )  # a changed key under the actor's own name
    write_run(tmp_path / "s", encoder="deterministic")  # hopper's own coding is poisson
    runs = read_study(tmp_path / "s").runs
    paper = dict(zip(runs["arm"], runs["paper"]))
    assert paper == {
        "bptsan": True,
        "bptsan [deterministic]": False,
        "bptsan-branches=4": False,
        "popsan (changed: actor.time_steps)": False,
    }


def test_evaluations_at_different_steps_keep_their_n(tmp_path):
    write_run(tmp_path / "s")
    run = write_run(tmp_path / "s", seed=1)
    rewrite(
        run / "evaluations.csv", lambda t: "".join(line for line in t.splitlines(True) if not line.startswith("50000,"))
    )
    (cell,) = cells_of(read_study(tmp_path / "s"))
    assert np.isnan(cell.returns[1, 5]) and np.isfinite(cell.returns[0]).all()


def test_adding_a_seed_changes_n(tmp_path):
    write_grid(tmp_path / "s", actors=("aan",), seeds=2)
    before = select(cells_of(read_study(tmp_path / "s")), arm="aan")[0].n
    write_run(tmp_path / "s", actor="aan", seed=9)
    assert (before, select(cells_of(read_study(tmp_path / "s")), arm="aan")[0].n) == (2, 3)


def test_seeds_sort_as_numbers_and_seed_zero_is_a_seed(tmp_path):
    for seed in (10, 2, 0):
        write_run(tmp_path / "s", seed=seed)
    assert read_study(tmp_path / "s").runs["seed"].tolist() == [0, 2, 10]


def test_manifest_without_optional_keys_is_read(tmp_path):
    run = write_run(tmp_path / "s")
    manifest = json.loads((run / "manifest.json").read_text())
    kept = ("format", "status", "algo", "env", "actor", "label", "encoder", "seed", "cell_hash", "total_steps")
    (run / "manifest.json").write_text(json.dumps({key: manifest[key] for key in kept}))
    assert len(read_study(tmp_path / "s").runs) == 1
