"""If these fail, a sentence says something else than the verdict that it is about."""

from dataclasses import replace

import pytest

from analysis.claims_file import read_claims
from analysis.data.cells import cells_of
from analysis.data.study import read_study
from analysis.verdicts import ArmSummary, Exclusion, Reason, Verdict, WithoutDivergence, judge, wording
from benchmarks.synthetic import write_grid, write_run

CLAIMS = read_claims()
HOPPER = replace(CLAIMS, tasks=("hopper",), claims=tuple(replace(c, tasks=("hopper",)) for c in CLAIMS.claims))


def judgement_of(folder, planned=5):
    study = read_study(folder)
    return judge(study, cells_of(study), replace(HOPPER, planned_seeds=planned))


def test_the_headline_names_every_answer_and_says_where_the_plan_is_not_done(tmp_path):
    effects = {"bptsan": 1500.0, "aan": 3000.0}
    write_grid(tmp_path / "s", effects, actors=("aan", "popsan", "bptsan"), seeds=6, noise=30)
    words = wording.headline(judgement_of(tmp_path / "s", planned=6))
    assert words.startswith("TD3: supported: BPT-SAN beats the regular SAN; contradicted: BPT-SAN beats the artificial")
    assert "not testable: BPT-SAN beats itself without dendrites" in words
    assert "TD3 (interim, 6 of 10 seeds): supported" in wording.headline(judgement_of(tmp_path / "s", planned=10))


def test_the_tasks_of_a_studys_own_plan_are_named_where_some_are_missing(tmp_path):
    write_grid(tmp_path / "s", {"bptsan": 1500.0}, actors=("popsan", "bptsan"), seeds=5, noise=30)
    study = read_study(tmp_path / "s")
    judgement = judge(study, cells_of(study), replace(CLAIMS, planned_seeds=5, tasks_planned=True))
    assert wording.headline(judgement).startswith("TD3 (interim, 1 of 4 planned tasks): supported: BPT-SAN beats the")
    assert "Seeds 0 to 4 on Hopper-v4, Walker2d-v4, HalfCheetah-v4 and Ant-v4 (N=111) decide." in " ".join(
        wording.rule_words(judgement)
    )


def test_many_claims_that_are_not_decided_are_counted_and_decided_ones_named(tmp_path):
    write_grid(tmp_path / "s", {"aan": 3000.0}, actors=("aan", "popsan", "bptsan"), seeds=5, noise=300)
    study = read_study(tmp_path / "s")
    equal, unequal = HOPPER.claims[0], HOPPER.claims[1]
    claims = (*(replace(equal, name=f"c{k}", text=f"claim {k}") for k in range(6)), unequal)
    words = wording.headline(judge(study, cells_of(study), replace(HOPPER, planned_seeds=5, claims=claims)))
    assert words == "TD3: undecided: 6 claims; contradicted: BPT-SAN beats the artificial network (AAN)."


def test_under_several_algorithms_the_headline_is_about_all_of_them(tmp_path):
    write_grid(tmp_path / "s", {"bptsan": 1500.0}, algos=("td3", "sac"), actors=("popsan", "bptsan"), seeds=5, noise=30)
    assert wording.headline(judgement_of(tmp_path / "s")).startswith(
        "TD3 and SAC: supported: BPT-SAN beats the regular"
    )


def test_too_few_seeds_are_said_once(tmp_path):
    write_grid(tmp_path / "s", actors=("popsan", "bptsan"), seeds=3)
    words = wording.headline(judgement_of(tmp_path / "s", planned=10))
    assert words == (
        "Too few seeds to judge: no claim has more than 3 finished seeds in all of its arms; 5 are needed and "
        "10 planned."
    )


def test_without_runs_and_without_pairs_the_headline_says_so(tmp_path):
    (tmp_path / "s/runs").mkdir(parents=True)
    assert wording.headline(judgement_of(tmp_path / "s")) == "No runs, so no verdicts."
    write_run(tmp_path / "s")
    assert wording.headline(judgement_of(tmp_path / "s")) == "No claim can be tested with these runs."


def test_equal_reasons_are_told_once(tmp_path):
    write_grid(tmp_path / "s", actors=("popsan", "bptsan"), seeds=5)
    (task,) = judgement_of(tmp_path / "s").results[0].tasks
    gone = [replace(task, env=env, exclusion=Exclusion(Reason.NO_RUNS, ("a", "b"))) for env in ("ant", "walker2d")]
    unequal = replace(task, exclusion=Exclusion(Reason.UNEQUAL_SETTINGS, ("aan", "bptsan"), ("threads (1, 2)",)))
    assert wording.exclusions([*gone, unequal, task]) == (
        "no runs on Walker2d-v4, Ant-v4 (N=111); AAN, BPT-SAN trained under different settings on Hopper-v4 "
        "(threads (1, 2))"
    )
    assert wording.exclusions([task]) == ""


@pytest.mark.parametrize(
    ("verdict", "equal", "words"),
    [
        (Verdict.SUPPORTED, True, "supported, smaller than relevant"),
        (Verdict.SUPPORTED, False, "supported"),
        (Verdict.UNDECIDED, True, "no relevant difference"),
        (Verdict.UNDECIDED, None, "undecided"),
    ],
)
def test_equality_is_part_of_the_verdict(tmp_path, verdict, equal, words):
    write_grid(tmp_path / "s", actors=("popsan", "bptsan"), seeds=1)
    result = judgement_of(tmp_path / "s").results[0]
    assert wording.verdict_words(replace(result, verdict=verdict, equal=equal)) == words


def test_diverged_runs_and_seeds_beyond_the_plan_are_counted_by_arm(tmp_path):
    arms = [ArmSummary("bptsan", 5, 2, 1, 0.2, 1, False), ArmSummary("aan", 5, 0, 0, 0.0, 0, False)]
    words = wording.divergence_words(arms, WithoutDivergence(Verdict.UNDECIDED, Verdict.SUPPORTED))
    assert words == (
        "diverged runs: BPT-SAN 1; with a random policy's score for them: undecided, without them: supported"
    )
    assert wording.divergence_words(arms[1:], None) == ""
    write_grid(tmp_path / "s", actors=("popsan", "bptsan"), seeds=1)
    task = replace(judgement_of(tmp_path / "s").results[0].tasks[0], arms=tuple(arms))
    words = wording.beyond_plan_words([task], 5)
    assert words == "seeds beyond the plan (0 to 4), drawn but not judged: BPT-SAN 2"
