"""If these fail, the report says that a claim holds, fails or is open when the logs say otherwise."""

import math
from dataclasses import replace

import numpy as np
import pytest
import yaml

from analysis.claims_file import Family, read_claims
from analysis.data.cells import cells_of
from analysis.data.study import read_study
from analysis.verdicts import Reason, Stage, Verdict, judge
from benchmarks.synthetic import SIZES, write_grid, write_run

CLAIMS = read_claims()
#: Verdicts from five seeds on, as if five had been planned.
FIVE = replace(CLAIMS, planned_seeds=5)
HOPPER = replace(FIVE, tasks=("hopper",), claims=tuple(replace(c, tasks=("hopper",)) for c in CLAIMS.claims))


def judgement_of(folder, claims=FIVE):
    study = read_study(folder)
    return judge(study, cells_of(study), claims)


def by(judgement, name, algo="td3"):
    return next(one for one in judgement.results if one.claim.name == name and one.algo == algo)


def test_a_planted_effect_is_found_on_every_task_and_in_both_directions(tmp_path):
    write_grid(tmp_path / "s", {"bptsan": 800.0, "aan": 2000.0}, envs=tuple(SIZES), seeds=5, noise=60)
    judgement = judgement_of(tmp_path / "s")
    found = {one.claim.name: one.every_task for one in judgement.results}
    assert found["bptsan_over_popsan"] is Verdict.SUPPORTED
    assert found["bptsan_over_aan"] is Verdict.CONTRADICTED
    assert found["synergy"] is Verdict.SUPPORTED  # 800 - 0 - 0 + 0
    one = by(judgement, "bptsan_over_popsan")
    assert one.covered == tuple(CLAIMS.tasks) and one.n == 5 and one.stage is Stage.FINAL
    # 800 of 3391, 4337, 11144 and 4833 units, the references' distances from a random policy
    assert one.pooled.estimate == pytest.approx(np.mean([23.6, 18.4, 7.2, 16.6]), abs=4)
    hopper = next(task for task in one.tasks if task.env == "hopper")
    assert hopper.contrast.estimate == pytest.approx(800, abs=250) and hopper.improvement.probability == 1
    assert hopper.normalised.estimate == pytest.approx(100 * hopper.contrast.estimate / (3410 - 19.43))


def test_additive_parts_are_no_synergy(tmp_path):
    curves = {"popsan": 1000.0, "bptsan_wo_li": 1500.0, "bptsan_wo_ndt": 1300.0, "bptsan": 1800.0}
    for actor, level in curves.items():
        for seed in range(5):
            write_run(tmp_path / "s", actor=actor, seed=seed, curve=np.full(11, level + seed))
    judgement = judgement_of(tmp_path / "s", HOPPER)
    assert by(judgement, "synergy").pooled.estimate == pytest.approx(0)
    assert by(judgement, "synergy").verdict is Verdict.UNDECIDED
    assert by(judgement, "bptsan_over_popsan").verdict is Verdict.SUPPORTED


def test_one_task_is_named_and_never_supports_a_claim_on_every_task(tmp_path):
    write_grid(tmp_path / "s", {"bptsan": 1500.0}, envs=("hopper",), seeds=5, noise=30)
    one = by(judgement_of(tmp_path / "s"), "bptsan_over_popsan")
    assert one.verdict is Verdict.SUPPORTED and one.every_task is Verdict.NOT_TESTABLE
    assert one.covered == ("hopper",)
    assert [(t.env, t.exclusion.reason) for t in one.missing] == [
        (env, Reason.NO_RUNS) for env in ("walker2d", "halfcheetah", "ant")
    ]


def test_seeds_beyond_the_plan_decide_nothing(tmp_path):
    write_grid(tmp_path / "s", actors=("popsan", "bptsan"), seeds=5, noise=300)
    before = by(judgement_of(tmp_path / "s", HOPPER), "bptsan_over_popsan")
    for seed in range(5, 12):
        write_run(tmp_path / "s", actor="bptsan", seed=seed, level=9000)
    after = by(judgement_of(tmp_path / "s", HOPPER), "bptsan_over_popsan")
    assert after.pooled == before.pooled and after.verdict is before.verdict
    assert [arm.beyond_plan for arm in after.tasks[0].arms] == [7, 0] and after.n == 5


def test_a_study_on_its_way_is_interim(tmp_path):
    write_grid(tmp_path / "s", {"bptsan": 2000.0}, actors=("popsan", "bptsan"), seeds=6, noise=30)
    claims = replace(HOPPER, planned_seeds=10)
    one = by(judgement_of(tmp_path / "s", claims), "bptsan_over_popsan")
    assert one.stage is Stage.INTERIM and one.n == 6 and one.verdict is Verdict.SUPPORTED
    assert one.tasks[0].verdict is None and one.every_task is None and one.equal is None


@pytest.mark.parametrize("seeds", [1, 2, 4])
def test_few_seeds_are_not_judged(tmp_path, seeds):
    write_grid(tmp_path / "s", {"bptsan": 2000.0}, seeds=seeds, noise=1)
    judgement = judgement_of(tmp_path / "s")
    one = by(judgement, "bptsan_over_popsan")
    assert judgement.too_few_seeds and one.verdict is Verdict.TOO_FEW_SEEDS
    hopper = one.tasks[0]
    assert hopper.exclusion.reason is Reason.TOO_FEW_SEEDS and hopper.contrast.estimate > 1500
    assert math.isnan(hopper.contrast.p) and math.isnan(hopper.contrast.low) == (seeds < 3)


def test_variants_never_enter_a_claim_of_the_paper(tmp_path):
    write_grid(tmp_path / "s", actors=("popsan",), seeds=5)
    for seed in range(5):
        write_run(tmp_path / "s", seed=seed, level=9000, changes={"actor.lateral.radius": 4})  # label bptsan, changed
        write_run(tmp_path / "s", seed=seed, level=9000, encoder="deterministic")
    one = by(judgement_of(tmp_path / "s", HOPPER), "bptsan_over_popsan")
    assert [arm.n for arm in one.tasks[0].arms] == [0, 5] and one.verdict is Verdict.NOT_TESTABLE
    assert one.missing[0].exclusion.reason is Reason.NO_FINISHED_RUN
    assert one.missing[0].exclusion.arms == ("bptsan",)


def test_another_actor_under_the_papers_label_enters_no_claim(tmp_path):
    write_grid(tmp_path / "s", actors=("popsan",), seeds=5)
    for seed in range(5):
        write_run(tmp_path / "s", actor="popsan", label="bptsan", seed=seed, level=9000)
    one = by(judgement_of(tmp_path / "s", HOPPER), "bptsan_over_popsan")
    assert [arm.n for arm in one.tasks[0].arms] == [0, 5]


def test_a_users_claim_may_name_a_variant_and_is_a_family_of_its_own(tmp_path):
    mine = {"name": "mine", "kind": "difference", "source": "user", "better": "bptsan-r4", "worse": "bptsan"}
    rule = {"alpha": 0.05, "power": 0.8, "planned_seeds": 5, "interim_alpha": 0.001, "smallest_effect": 15}
    paper = {"name": "p", "kind": "difference", "source": "paper", "better": "bptsan", "worse": "popsan"}
    (tmp_path / "claims.yaml").write_text(yaml.safe_dump(rule | {"tasks": ["hopper"], "claims": [paper, mine]}))
    for seed in range(5):
        write_run(tmp_path / "s", seed=seed, noise=10)
        changes = {"actor.lateral.radius": 4}
        write_run(tmp_path / "s", seed=seed, noise=10, level=4000, label="bptsan-r4", changes=changes)
    judgement = judgement_of(tmp_path / "s", read_claims(tmp_path / "claims.yaml"))
    assert [(r.claim.family, r.verdict) for r in judgement.results] == [
        (Family.DECLARED, Verdict.NOT_TESTABLE),
        (Family.USER, Verdict.SUPPORTED),
    ]
    assert by(judgement, "mine").adjusted_p == by(judgement, "mine").pooled.p


def test_labels_that_no_claim_names_are_compared_with_the_baselines_that_are_there(tmp_path):
    write_grid(tmp_path / "s", actors=("aan",), seeds=5)
    for seed in range(5):
        write_run(tmp_path / "s", actor="aan", label="my_actor", seed=seed, level=5000, noise=30)
        write_run(tmp_path / "s", env="walker2d", actor="aan", label="my_actor", seed=seed, noise=30)
    judgement = judgement_of(tmp_path / "s")
    own = [one for one in judgement.results if one.claim.family is Family.EXPLORATORY]
    assert [one.claim.arms for one in own] == [("my_actor", "aan")]  # popsan is not there
    assert own[0].claim.tasks == ("hopper", "walker2d") and own[0].covered == ("hopper",)
    assert own[0].verdict is Verdict.SUPPORTED
    chosen = judgement_of(tmp_path / "s", replace(FIVE, baselines=("my_actor",)))
    assert not [one for one in chosen.results if one.claim.family is Family.EXPLORATORY]  # aan is named by a claim


def test_a_task_without_reference_takes_the_studys_own_aan_as_hundred(tmp_path, monkeypatch):
    from analysis import references

    content = {"random_policy": references.references()["random_policy"], "aan_reference": {}}
    monkeypatch.setattr(references, "references", lambda: content)
    for actor, level in (("aan", 1000.0), ("popsan", 1000.0), ("bptsan", 1500.0)):
        for seed in range(5):
            write_run(tmp_path / "s", actor=actor, seed=seed, curve=np.full(11, level + seed))
    one = by(judgement_of(tmp_path / "s", HOPPER), "bptsan_over_popsan")
    assert one.tasks[0].scale.own and one.tasks[0].scale.hundred == 1002.0
    assert one.pooled.estimate == pytest.approx(100 * 500 / (1002 - 19.43))


def test_arms_trained_under_different_settings_are_not_compared(tmp_path):
    write_grid(tmp_path / "s", actors=("popsan", "aan"), seeds=5)
    for seed in range(5):
        write_run(tmp_path / "s", seed=seed, level=9000, changes={"normalize_observations": False})
    one = by(judgement_of(tmp_path / "s", HOPPER), "bptsan_over_popsan")
    (task,) = one.missing
    assert task.exclusion.reason is Reason.UNEQUAL_SETTINGS and "normalize_observations" in task.exclusion.details[0]
    assert np.isnan([task.contrast.estimate, task.effect]).all() and task.improvement is None


def test_the_actors_own_learning_rate_does_not_bar_a_claim(tmp_path):
    write_grid(tmp_path / "s", {"bptsan": 1000.0}, algos=("sac",), actors=("aan", "bptsan"), seeds=5, noise=50)
    assert by(judgement_of(tmp_path / "s", HOPPER), "bptsan_over_aan", "sac").verdict is Verdict.SUPPORTED


def test_diverged_runs_count_and_the_verdicts_without_them_stand_beside(tmp_path):
    write_grid(tmp_path / "s", {"bptsan": 1500.0}, actors=("popsan", "bptsan"), seeds=5, noise=40)
    write_run(tmp_path / "s", seed=5, status="diverged", stop=20_000, curve=np.array([0.0, -3000.0, -90_000.0]))
    one = by(judgement_of(tmp_path / "s", replace(HOPPER, planned_seeds=6)), "bptsan_over_popsan")
    assert [arm.diverged for arm in one.tasks[0].arms] == [1, 0] and [arm.n for arm in one.tasks[0].arms] == [6, 5]
    assert one.stage is Stage.INTERIM and one.diverged.left_out is Verdict.SUPPORTED
    assert (one.verdict, one.diverged.random_score) == (Verdict.UNDECIDED, Verdict.UNDECIDED)


def test_two_groups_of_seeds_are_seen_and_said(tmp_path):
    from analysis.forest_rows import rows_of
    from analysis.verdicts.wording import bimodality_words

    write_grid(tmp_path / "s", actors=("popsan", "bptsan"), seeds=3, noise=20)
    for seed in (3, 4):
        write_run(tmp_path / "s", actor="popsan", seed=seed, level=3000, noise=20)
        write_run(tmp_path / "s", actor="bptsan", seed=seed, level=100, noise=20)
    judgement = judgement_of(tmp_path / "s", HOPPER)
    (task,) = by(judgement, "bptsan_over_popsan").tasks
    assert any("two groups of seeds in BPT-SAN: the mean" in row.remark for row in rows_of(judgement, "td3"))
    assert [arm.bimodal for arm in task.arms] == [True, False]
    assert [arm.below_half for arm in task.arms] == [0.4, 0.0]
    assert "two groups of seeds in BPT-SAN" in bimodality_words(task) and "P(improvement)" in bimodality_words(task)


def test_under_several_algorithms_a_claim_needs_each_and_one_contradicts(tmp_path):
    both = {"bptsan": 1500.0, "aan": 3000.0}
    write_grid(tmp_path / "s", both, algos=("td3", "sac"), actors=("aan", "popsan", "bptsan"), seeds=5, noise=40)
    judgement = judgement_of(tmp_path / "s", HOPPER)
    found = {one.claim.name: one for one in judgement.over_algorithms}
    assert found["bptsan_over_popsan"].verdict is Verdict.SUPPORTED
    assert found["bptsan_over_popsan"].every_task is Verdict.SUPPORTED
    assert found["bptsan_over_aan"].verdict is Verdict.CONTRADICTED
    assert found["synergy"].verdict is Verdict.NOT_TESTABLE
    assert found["bptsan_over_popsan"].algos == ("td3", "sac")
    p = max(one.pooled.p for one in found["bptsan_over_popsan"].each)
    assert found["bptsan_over_popsan"].adjusted_p == pytest.approx(5 * p, rel=1e-6, abs=0)


def test_a_claim_that_one_algorithm_leaves_open_is_open_for_all(tmp_path):
    write_grid(tmp_path / "s", {"bptsan": 1500.0}, actors=("popsan", "bptsan"), seeds=5, noise=40)
    write_grid(tmp_path / "s", algos=("sac",), actors=("popsan", "bptsan"), seeds=5, noise=40)
    judgement = judgement_of(tmp_path / "s", HOPPER)
    assert by(judgement, "bptsan_over_popsan").verdict is Verdict.SUPPORTED
    one = next(one for one in judgement.over_algorithms if one.claim.name == "bptsan_over_popsan")
    assert one.verdict is Verdict.UNDECIDED and one.adjusted_p > 0.05
    other = next(one for one in judgement.over_algorithms if one.claim.name == "synergy")
    assert math.isnan(other.adjusted_p)  # not testable


def test_one_algorithm_alone_has_no_row_for_all(tmp_path):
    write_grid(tmp_path / "s", actors=("popsan", "bptsan"), seeds=1)
    assert judgement_of(tmp_path / "s").over_algorithms == ()


def test_nothing_is_told_of_a_pair_that_was_trained_under_different_settings(tmp_path):
    from analysis.figures.probability_of_improvement import draw
    from analysis.figures.view import View

    write_grid(tmp_path / "s", actors=("popsan", "aan"), seeds=4)
    for seed in range(4):
        write_run(tmp_path / "s", seed=seed, level=9000, changes={"normalize_observations": False})
    study = read_study(tmp_path / "s")
    cells = cells_of(study)
    (drawing,) = draw(View(study, cells, CLAIMS, judge(study, cells, CLAIMS), "td3"))
    assert drawing.figure is None
    assert "trained under different settings on Hopper-v4 (normalize_observations" in drawing.missing


def test_a_task_outside_the_claims_makes_no_arm_incomplete(tmp_path):
    from analysis.statistics.aggregates import complete_arms, left_out, tasks_of

    write_grid(tmp_path / "s", actors=("aan", "popsan", "bptsan"), seeds=3)
    write_grid(tmp_path / "s", envs=("walker2d",), actors=("aan", "popsan"), seeds=3)
    study = read_study(tmp_path / "s")
    cells = cells_of(study)
    assert tasks_of(cells, "td3", CLAIMS) == ["hopper", "walker2d"]
    assert complete_arms(cells, "td3", CLAIMS) == ["aan", "popsan"]
    assert left_out(cells, "td3", CLAIMS) == " Left out: BPT-SAN (no finished run on Walker2d-v4)."
    only = replace(CLAIMS, tasks=("hopper",))
    assert complete_arms(cells, "td3", only) == ["aan", "popsan", "bptsan"] and left_out(cells, "td3", only) == ""
