"""If these fail, two different actors or configurations pass for the seeds of one."""

import pytest

from analysis.data.collected import collect, load
from analysis.data.errors import InputError
from analysis.data.study import read_study
from tests.analysis.synthetic import write_run


@pytest.mark.parametrize("seed", [0, 1], ids=["same-seed", "disjoint-seeds"])
def test_two_actors_under_one_label_in_different_encoder_folders_are_refused(tmp_path, seed):
    """``label=lr3 actor=aan,bptsan``: the folders are ``none`` and ``poisson``, the arm is the same."""
    write_run(tmp_path / "s", actor="aan", label="lr3", seed=0)
    write_run(tmp_path / "s", actor="bptsan", label="lr3", seed=seed)
    with pytest.raises(InputError, match="lr3 mixes two configurations") as error:
        read_study(tmp_path / "s")
    assert f"none/seed_0 and poisson/seed_{seed} differ in actor" in str(error.value)
    assert "actor.kind: mlp against spiking" in str(error.value) and "more keys" in str(error.value)


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
