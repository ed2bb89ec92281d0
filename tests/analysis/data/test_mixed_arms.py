"""If these fail, two different actors or configurations pass for the seeds of one."""

import json

import numpy as np
import pytest

from analysis.__main__ import main
from analysis.data.collected import collect, load
from analysis.data.study import read_study
from benchmarks.synthetic import configuration, write_run


@pytest.mark.parametrize("seed", [0, 1], ids=["same-seed", "disjoint-seeds"])
def test_two_actors_under_one_label_in_different_encoder_folders_are_refused(tmp_path, seed):
    """``label=lr3 actor=aan,bptsan``: the folders are ``none`` and ``poisson``, the arm is the same."""
    write_run(tmp_path / "s", actor="aan", label="lr3", seed=0)
    write_run(tmp_path / "s", actor="bptsan", label="lr3", seed=seed)
    study = read_study(tmp_path / "s")
    (refused,) = study.refused
    assert study.runs.empty and (refused.arm, refused.seeds) == ("lr3", (0, seed))
    assert f"none/seed_0 and poisson/seed_{seed} differ in actor" in refused.reason
    assert "actor.kind: mlp against spiking" in refused.reason and "more keys" in refused.reason


def test_a_mixed_cell_is_refused_with_its_keys_and_all_others_stand(tmp_path, capsys):
    write_run(tmp_path / "s")
    write_run(tmp_path / "s", seed=1, changes={"protocol.evaluation_interval": 100, "normalize_observations": False})
    write_run(tmp_path / "s", env="ant")
    write_run(tmp_path / "s", actor="popsan")
    study = read_study(tmp_path / "s")
    assert list(zip(study.runs["env"], study.runs["arm"])) == [("ant", "bptsan"), ("hopper", "popsan")]
    assert set(zip(study.evaluations["env"], study.evaluations["arm"])) == {("ant", "bptsan"), ("hopper", "popsan")}
    (refused,) = study.refused
    assert (refused.algo, refused.env, refused.arm, refused.seeds) == ("td3", "hopper", "bptsan", (0, 1))
    keys = "normalize_observations: True against False; protocol.evaluation_interval: 10000 against 100"
    assert f"seed_0 and seed_1 differ in {keys}" in refused.reason
    assert study.warnings[0] == f"td3/hopper/bptsan was refused (seeds 0, 1): {refused.reason}"
    collect(tmp_path / "s")
    assert load(tmp_path / "s").refused == [refused]
    capsys.readouterr()
    assert main(["compare", "bptsan", "popsan", "--study", str(tmp_path / "s")]) == 2
    assert "td3/hopper/bptsan of s is refused: runs/td3/hopper/bptsan/poisson mixes" in capsys.readouterr().err


def test_the_report_shows_a_mixed_cell_as_refused_and_the_other_cells(tmp_path):
    for seed in range(2):
        write_run(tmp_path / "s", actor="popsan", seed=seed, noise=10)
    write_run(tmp_path / "s")
    write_run(tmp_path / "s", seed=3, changes={"actor.lateral.radius": 4}, manifest={"changed_keys": {}})
    assert main(["report", str(tmp_path / "s")]) == 0
    page = (tmp_path / "s/report/report.md").read_text()
    assert "td3/hopper/bptsan was refused (seeds 0, 3)" in page and "actor.lateral.radius: 2 against 4" in page
    status = (tmp_path / "s/statistics/runs.csv").read_text()
    assert "td3,hopper,bptsan" in status and status.splitlines()[2].endswith('"0, 3"')
    assert "1 more cell refused" in page and "| BPT-SAN | refused |" in page
    assert "the notes name the keys): BPT-SAN on Hopper-v4 with TD3." in page


def test_a_config_that_was_edited_after_the_run_is_noted_though_its_hash_is_equal(tmp_path):
    write_run(tmp_path / "s")
    run = write_run(tmp_path / "s", seed=1, noise=1)
    config = (run / "config.yaml").read_text()
    (run / "config.yaml").write_text(config.replace("discount: 0.99", "discount: 0.9"))
    study = read_study(tmp_path / "s")
    (note,) = study.warnings
    assert "same cell_hash" in note and "algo.discount: 0.99 against 0.9" in note
    assert study.runs["counts_as"].tolist() == ["finished", "finished"]


def test_the_keys_that_the_manifest_lists_decide_what_differs(tmp_path):
    """The training code knows what it hashed: a later key with its old behaviour is no difference, one set is."""
    for seed, listed in enumerate((["algo.discount"], ["algo.discount", "backend"])):
        write_run(tmp_path / "s", seed=seed, changes={"backend": "fast"}, manifest={"hashed_keys": listed})
    for run in (tmp_path / "s/runs/td3/hopper/bptsan/poisson").iterdir():
        manifest = json.loads((run / "manifest.json").read_text())
        (run / "manifest.json").write_text(json.dumps(manifest | {"cell_hash": run.name, "changed_keys": {}}))
    first = tmp_path / "s/runs/td3/hopper/bptsan/poisson/seed_0/config.yaml"
    first.write_text(first.read_text().replace("backend: fast", "backend: auto").replace("threads: 1", "threads: 8"))
    (refused,) = read_study(tmp_path / "s").refused
    assert "differ in backend: auto against fast." in refused.reason  # and not in threads, which neither lists


def test_an_empty_list_of_hashed_keys_is_an_old_manifest_written_again(tmp_path):
    write_run(tmp_path / "s", manifest={"hashed_keys": []})
    write_run(tmp_path / "s", seed=1, changes={"algo.discount": 0.9}, manifest={"hashed_keys": [], "changed_keys": {}})
    (refused,) = read_study(tmp_path / "s").refused
    assert "algo.discount: 0.99 against 0.9" in refused.reason


def test_several_backends_are_said_and_stand_among_the_versions(tmp_path):
    """And do not keep arms from being compared: their updates are the same up to the last bits."""
    from analysis.data.cells import cells_of
    from analysis.data.confounds import confounds
    from analysis.statistics.provenance import versions_table

    write_run(tmp_path / "s", actor="aan", manifest={"backend": "fast"})
    for seed, backend in enumerate(("plain", "fast")):
        write_run(tmp_path / "s", seed=seed, noise=1, changes={"backend": "plain"}, manifest={"backend": backend})
    study = read_study(tmp_path / "s")
    (note,) = study.warnings
    assert "several backends (fast in 2 (aan, bptsan); plain in 1 (bptsan))" in note
    frame = versions_table(study).frame
    rows = frame[frame["what"] == "backend"]
    assert rows["value"].tolist() == ["fast", "plain"] and rows["runs"].tolist() == [2, 1]
    assert [cell.n for cell in cells_of(study)] == [1, 2]
    assert confounds(study, "td3", "hopper", ("bptsan", "aan")) == []


def test_several_blas_libraries_are_said(tmp_path):
    for seed, library in enumerate(("mkl", "openblas", "openblas")):
        about = {"library": library, "version": "1.2", "architecture": None}
        write_run(tmp_path / "s", seed=seed, noise=1, manifest={"blas": about})
    collect(tmp_path / "s")
    study = load(tmp_path / "s")
    assert study.runs["blas"].tolist() == ["mkl 1.2", "openblas 1.2", "openblas 1.2"]
    (note,) = study.warnings
    assert "mkl in 1, openblas in 2 runs" in note


def test_another_actors_name_is_named_as_the_difference(tmp_path):
    """It is hashed: a refusal that says "no key of config.yaml" would leave the reader without a way out."""
    write_run(tmp_path / "s", actor="aan", label="mine")
    write_run(
        tmp_path / "s", actor="aan", label="mine", seed=1, changes={"actor.name": "aan2"}, manifest={"actor": "aan2"}
    )
    (refused,) = read_study(tmp_path / "s").refused
    assert "actor.name: aan against aan2" in refused.reason


def test_the_rule_for_old_manifests_is_the_one_that_the_training_code_hashes_by():
    from analysis.data.flatten import NOT_HASHED, flatten
    from src.config.identity import ADDED_KEYS, hashed_values

    config = configuration("sac", "ant", "bptsan") | {"blas": "auto", "keep_best": True}
    old = flatten(config).keys() - ADDED_KEYS.keys()  # a run without the list is older than all of these
    kept = {key for key in old if not {key, key.partition(".")[0]} & NOT_HASHED}
    assert kept == hashed_values(config).keys()


def test_copied_seeds_are_noted(tmp_path):
    write_run(tmp_path / "s", curve=np.linspace(0, 500, 11))
    write_run(tmp_path / "s", seed=4, curve=np.linspace(0, 500, 11) * (1 + 1e-12))
    write_run(tmp_path / "s", seed=7, curve=np.linspace(0, 500, 11))
    write_run(tmp_path / "s", seed=5, curve=np.linspace(0, 501, 11))
    (note,) = read_study(tmp_path / "s").warnings
    assert "seeds 0, 4, 7 have the same returns" in note


def test_the_same_label_under_another_task_or_coding_is_another_arm(tmp_path):
    write_run(tmp_path / "s", label="mine")
    write_run(tmp_path / "s", env="ant", label="mine")
    write_run(tmp_path / "s", label="mine", encoder="deterministic")
    assert read_study(tmp_path / "s").runs["arm"].tolist() == ["mine", "mine [deterministic]", "mine"]


def test_another_actor_under_a_paper_actors_name_says_so(tmp_path):
    write_run(tmp_path / "s", actor="popsan", label="bptsan")
    runs = read_study(tmp_path / "s").runs
    assert runs["arm"].tolist() == ["bptsan (actor: popsan)"] and not runs["paper"].any()


@pytest.mark.parametrize("label", ["NA", "null", "nan", "None", "1e5"])
def test_a_label_that_looks_like_a_missing_value_stays_a_label(tmp_path, label):
    write_run(tmp_path / "s", label=label)
    collect(tmp_path / "s")
    study = load(tmp_path / "s")
    assert study.runs["arm"].tolist() == [label] == study.evaluations["arm"].unique().tolist()
