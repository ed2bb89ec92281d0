"""If these fail, the report says that a claim holds, fails or is open when the numbers say otherwise."""

import numpy as np
import pytest

from analysis.claims import decide, overall
from analysis.claims_file import read_claims
from analysis.data.cells import cells_of
from analysis.data.errors import InputError
from analysis.data.study import read_study
from tests.analysis.synthetic import LEVELS, SIZES, write_grid, write_run

CLAIMS = read_claims()


def verdicts(folder, claims=CLAIMS):
    study = read_study(folder)
    rows = decide(study, cells_of(study), claims)
    return rows, overall(rows, claims)


def by(rows, claim, env="hopper"):
    return next(row for row in rows if row.claim.name == claim and row.env == env)


def test_a_planted_effect_is_found_on_every_task_and_in_both_directions(tmp_path):
    effects = {"bptsan": 800.0, "aan": 2000.0}
    write_grid(tmp_path / "s", effects, envs=tuple(SIZES), seeds=5, noise=60)
    rows, results = verdicts(tmp_path / "s")
    found = {result.claim.name: result.verdict for result in results}
    assert found["bptsan_over_popsan"] == "supported"
    assert found["bptsan_over_aan"] == "contradicted"
    assert found["synergy"] == "supported"  # 800 - 0 - 0 + 0
    row = by(rows, "bptsan_over_popsan")
    assert row.contrast.estimate == pytest.approx(800, abs=250) and row.contrast.low > 0 and row.improvement[0] == 1
    assert row.adjusted_p >= row.contrast.p


def test_no_effect_is_undecided_and_not_called_equal(tmp_path):
    write_grid(tmp_path / "s", envs=("hopper",), seeds=6, noise=300)
    rows, _ = verdicts(tmp_path / "s")
    assert {row.verdict for row in rows} == {"undecided"}
    row = by(rows, "bptsan_over_popsan")
    assert "not equality" in row.why
    assert row.seeds_unadjusted is None or row.seeds_adjusted is None or row.seeds_adjusted > row.seeds_unadjusted > 6


def test_additive_parts_are_no_synergy(tmp_path):
    curves = {"popsan": 1000.0, "bptsan_wo_li": 1500.0, "bptsan_wo_ndt": 1300.0, "bptsan": 1800.0}
    for actor, level in curves.items():
        for seed in range(5):
            write_run(tmp_path / "s", actor=actor, seed=seed, curve=np.full(11, level + seed))
    rows, _ = verdicts(tmp_path / "s")
    assert by(rows, "synergy").contrast.estimate == pytest.approx(0)
    assert by(rows, "synergy").verdict == "undecided"
    assert by(rows, "bptsan_over_popsan").verdict == "supported"


def test_one_task_never_supports_a_claim_on_every_task(tmp_path):
    write_grid(tmp_path / "s", {"bptsan": 1500.0}, envs=("hopper",), seeds=5, noise=30)
    rows, results = verdicts(tmp_path / "s")
    assert by(rows, "bptsan_over_popsan").verdict == "supported"
    result = next(r for r in results if r.claim.name == "bptsan_over_popsan")
    assert result.verdict == "undecided"
    assert "supported on Hopper-v4; not testable on Walker2d-v4" in result.why


@pytest.mark.parametrize("seeds", [1, 2])
def test_few_seeds_are_undecided_without_an_interval(tmp_path, seeds):
    write_grid(tmp_path / "s", {"bptsan": 2000.0}, seeds=seeds, noise=1)
    rows, _ = verdicts(tmp_path / "s")
    row = by(rows, "bptsan_over_popsan")
    assert row.verdict == "undecided" and "fewer than 3" in row.why
    assert row.contrast.estimate > 1500 and np.isnan([row.contrast.low, row.contrast.p, row.improvement[1]]).all()


def test_variants_never_enter_a_claim_of_the_paper(tmp_path):
    write_grid(tmp_path / "s", actors=("popsan",), seeds=4)
    for seed in range(4):
        write_run(
            tmp_path / "s", seed=seed, level=9000, changes={"actor.lateral.radius": 4}
        )  # label bptsan, but changed
        write_run(tmp_path / "s", seed=seed, level=9000, encoder="deterministic")
    rows, _ = verdicts(tmp_path / "s")
    row = by(rows, "bptsan_over_popsan")
    assert row.n == (0, 4) and row.verdict == "undecided" and "no finished run of BPT-SAN" in row.why


def test_another_actor_under_the_papers_label_enters_no_claim(tmp_path):
    write_grid(tmp_path / "s", actors=("popsan",), seeds=4)
    for seed in range(4):
        write_run(tmp_path / "s", actor="popsan", label="bptsan", seed=seed, level=9000)
    rows, _ = verdicts(tmp_path / "s")
    assert by(rows, "bptsan_over_popsan").n == (0, 4)


def test_a_users_claim_may_name_a_variant(tmp_path):
    (tmp_path / "claims.yaml").write_text(
        "alpha: 0.05\npower: 0.8\ntasks: [hopper]\nclaims:\n"
        "  - {name: mine, kind: difference, source: user, text: Mine, better: bptsan-r4, worse: bptsan}\n"
    )
    for seed in range(4):
        write_run(tmp_path / "s", seed=seed, noise=10)
        write_run(
            tmp_path / "s", seed=seed, noise=10, level=4000, label="bptsan-r4", changes={"actor.lateral.radius": 4}
        )
    _, results = verdicts(tmp_path / "s", read_claims(tmp_path / "claims.yaml"))
    assert [result.verdict for result in results] == ["supported"]


def test_arms_trained_under_different_settings_are_not_compared(tmp_path):
    write_grid(tmp_path / "s", actors=("popsan",), seeds=4)
    for seed in range(4):
        write_run(tmp_path / "s", seed=seed, level=9000, changes={"normalize_observations": False})
    rows, _ = verdicts(tmp_path / "s")
    row = by(rows, "bptsan_over_popsan")
    assert row.verdict == "undecided" and "normalize_observations" in row.why


def test_the_actors_own_learning_rate_does_not_bar_a_claim(tmp_path):
    write_grid(tmp_path / "s", {"bptsan": 1000.0}, algos=("sac",), actors=("aan", "bptsan"), seeds=4, noise=50)
    rows, _ = verdicts(tmp_path / "s")
    assert by(rows, "bptsan_over_aan").verdict == "supported"


def test_diverged_runs_count_and_the_verdict_without_them_is_given(tmp_path):
    write_grid(tmp_path / "s", {"bptsan": 1500.0}, actors=("popsan", "bptsan"), seeds=4, noise=40)
    write_run(tmp_path / "s", seed=4, status="diverged", stop=20_000, curve=np.array([0.0, -3000.0, -9000.0]))
    rows, _ = verdicts(tmp_path / "s")
    row = by(rows, "bptsan_over_popsan")
    assert row.diverged == (1, 0) and row.n == (5, 4)
    assert (row.verdict, row.without_diverged) == ("undecided", "supported")


def test_holm_runs_over_all_rows_of_one_algorithm(tmp_path):
    write_grid(tmp_path / "s", {"bptsan": 300.0}, algos=("td3", "sac"), seeds=5, noise=150)
    rows, _ = verdicts(tmp_path / "s")
    for algo in ("td3", "sac"):
        family = sorted((r.contrast.p, r.adjusted_p) for r in rows if r.algo == algo and not np.isnan(r.contrast.p))
        assert len(family) == 5  # five claims on the one task
        assert family[0][1] == pytest.approx(min(1, 5 * family[0][0]))


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        ("- a", "expected the keys"),
        ("alpha: 2.0\npower: 0.8\ntasks: []\nclaims: []", "between 0 and 1"),
        ("alpha: 0.05\npower: 0.8\ntasks: [a]\nclaims: [{name: x, kind: guess}]", "kind should be"),
        (
            "alpha: 0.05\npower: 0.8\ntasks: [a]\nclaims: [{name: x, kind: difference, source: user, better: a}]",
            "worse should name",
        ),
        (
            "alpha: 0.05\npower: 0.8\ntasks: [a]\nclaims: [{name: x, kind: difference, source: user, better: a, "
            "worse: b, bse: c}]",
            "no key bse",
        ),
        ("a: [", "not valid YAML"),
    ],
)
def test_a_wrong_claims_file_gives_a_sentence(tmp_path, content, sentence):
    (tmp_path / "claims.yaml").write_text(content)
    with pytest.raises(InputError, match=sentence):
        read_claims(tmp_path / "claims.yaml")


def test_levels_cover_the_papers_tasks():
    assert set(CLAIMS.tasks) == set(LEVELS)


def test_nothing_is_told_of_a_pair_that_was_trained_under_different_settings(tmp_path):
    from analysis.figures.probability_of_improvement import draw

    write_grid(tmp_path / "s", actors=("popsan", "aan"), seeds=4)
    for seed in range(4):
        write_run(tmp_path / "s", seed=seed, level=9000, changes={"normalize_observations": False})
    study = read_study(tmp_path / "s")
    rows = decide(study, cells_of(study), CLAIMS)
    row = by(rows, "bptsan_over_popsan")
    assert np.isnan([row.contrast.estimate, row.effect, *row.improvement]).all() and row.reason == "settings"
    (drawing,) = draw(study, cells_of(study), "td3", CLAIMS)
    assert drawing.figure is None and "BPT-SAN > AAN on Hopper-v4 (normalize_observations" in drawing.missing


def test_both_algorithms_are_summed_up_in_one_row(tmp_path):
    write_grid(tmp_path / "s", {"bptsan": 800.0}, envs=tuple(SIZES), actors=("popsan", "bptsan"), seeds=4, noise=30)
    write_grid(tmp_path / "s", algos=("sac",), actors=("popsan", "bptsan"), seeds=4, noise=30)
    _, results = verdicts(tmp_path / "s")
    found = [(r.algo, r.verdict) for r in results if r.claim.name == "bptsan_over_popsan"]
    assert found == [("td3 and sac", "undecided"), ("td3", "supported"), ("sac", "undecided")]
    assert "TD3: supported on" in results[0].why and "SAC: undecided on" in results[0].why


def test_a_task_outside_the_claims_makes_no_arm_incomplete(tmp_path):
    from analysis.statistics.aggregates import complete_arms, left_out, tasks_of

    write_grid(tmp_path / "s", actors=("aan", "popsan", "bptsan"), seeds=3)
    write_grid(tmp_path / "s", envs=("walker2d",), actors=("aan", "popsan"), seeds=3)
    study = read_study(tmp_path / "s")
    cells = cells_of(study)
    assert tasks_of(cells, "td3", CLAIMS) == ["hopper", "walker2d"]
    assert complete_arms(cells, "td3", CLAIMS) == ["aan", "popsan"]
    assert left_out(cells, "td3", CLAIMS) == " Left out: BPT-SAN (no finished run on Walker2d-v4)."
    from dataclasses import replace

    only = replace(CLAIMS, tasks=("hopper",))
    assert complete_arms(cells, "td3", only) == ["aan", "popsan", "bptsan"] and left_out(cells, "td3", only) == ""


@pytest.mark.parametrize("minimum", ["2", "yes", "3.5"])
def test_fewer_than_three_seeds_cannot_be_asked_for(tmp_path, minimum):
    (tmp_path / "c.yaml").write_text(f"alpha: 0.05\npower: 0.8\nminimum_seeds: {minimum}\ntasks: [a]\nclaims: []\n")
    with pytest.raises(InputError, match="at least 3"):
        read_claims(tmp_path / "c.yaml")
