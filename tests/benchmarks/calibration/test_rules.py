"""If these fail, what is calibrated is not the rule that judges studies."""

import numpy as np
import pytest

from analysis.claims_file import read_claims
from analysis.references import Scale
from analysis.verdicts import Verdict
from analysis.verdicts.layers import contrasts_of, judge_family
from analysis.verdicts.samples import Sample, TaskSample
from benchmarks.calibration.laws import LAWS
from benchmarks.calibration.rules import CLAIMS, Rule, contrasts, judge

ACTORS = ("bptsan", "popsan", "aan", "bptsan_wo_ndt", "bptsan_wo_li")
CODES = {Verdict.SUPPORTED: 1, Verdict.CONTRADICTED: -1, Verdict.UNDECIDED: 0, None: 0}


def by_the_analysis(runs, claims):
    """The verdicts of one study ``[actors, tasks, seeds]``."""
    samples = []
    for claim in claims.claims:
        tasks = []
        for k, env in enumerate(claims.tasks):
            arms = tuple(runs[ACTORS.index(arm), k] for arm in claim.arms)
            none = tuple(np.zeros(len(arm), dtype=bool) for arm in arms)
            tasks.append(TaskSample(env, arms, none, (0,) * len(arms), Scale(0.0, 100.0), None))
        samples.append(Sample("td3", claim, tuple(tasks)))
    return judge_family([contrasts_of(sample) for sample in samples], claims)


def test_the_claims_are_the_projects():
    for weights, claim in zip(CLAIMS, read_claims().claims, strict=True):
        assert {ACTORS[k]: w for k, w in enumerate(weights) if w} == dict(zip(claim.arms, claim.weights))


@pytest.mark.parametrize("law", LAWS, ids=[law.name for law in LAWS])
@pytest.mark.parametrize("n", [6, 10])
def test_both_forms_of_the_rule_answer_alike(law, n, monkeypatch):
    monkeypatch.setattr("gc.collect", lambda *_: 0)  # statsmodels collects garbage at each of 200 corrections
    generator, claims, size = np.random.default_rng(0), read_claims(), 12
    runs = 80 + 8 * law.draw(generator, (size, 5, 4, n))
    runs[:, 0] += generator.normal(0, 12, (size, 4))[:, :, None]  # effects of all sizes, different on each task
    judged, study = judge(runs, Rule(planned_seeds=10)), contrasts(runs)
    p_values, answers = study.pooled.two_sided(), set()
    for k in range(size):
        for c, one in enumerate(by_the_analysis(runs[k], claims)):
            assert study.pooled.estimate[k, c] == pytest.approx(one.tested.pooled.estimate)
            assert p_values[k, c] == pytest.approx(one.tested.pooled.p)
            assert judged.claims[k, c] == CODES[one.verdict]
            assert list(judged.tasks[k, c]) == [CODES[row.verdict] for row in one.rows]
            assert judged.every_task[k, c] == CODES[one.every_task]
            assert judged.equal[k, c] == bool(one.equal)
            answers |= {one.verdict, one.every_task, one.equal}
    if n == 10:  # the study is one that shows every answer
        assert answers >= {Verdict.SUPPORTED, Verdict.CONTRADICTED, Verdict.UNDECIDED, True, False}


@pytest.mark.parametrize("law", LAWS, ids=[law.name for law in LAWS])
def test_laws_have_mean_zero_and_standard_deviation_one(law):
    values = law.draw(np.random.default_rng(0), (400_000,))
    assert (values.mean(), values.std()) == pytest.approx((0, 1), abs=0.03)
