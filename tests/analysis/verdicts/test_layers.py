"""If these fail, the verdict rule answers more, less or something else than version 2."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.stats
from statsmodels.stats.multitest import multipletests

from analysis.claims_file import Claim, Claims, Family, Kind
from analysis.references import Scale
from analysis.verdicts import Exclusion, Reason, Stage, Verdict
from analysis.verdicts.layers import contrasts_of, judge_family
from analysis.verdicts.samples import Sample, TaskSample

TASKS = ("hopper", "ant")
RULE = Claims(0.05, 0.8, 10, 0.001, 15.0, 50.0, ("aan",), TASKS, ())
#: 100 units of return are 10 points on hopper, 20 on ant.
SCALES = {"hopper": Scale(0.0, 1000.0), "ant": Scale(-100.0, 400.0)}
STEPS = np.linspace(-1.5, 1.5, 10)  # standard deviation about 1


def sample(name="a", n=10, spread=5.0, exclusion=None, **effects):
    """A difference whose arms differ by so many points on each task, with a standard deviation of ``spread``."""
    claim = Claim(name, name, Kind.DIFFERENCE, Family.DECLARED, ("x", "y"), (1.0, -1.0), TASKS)
    tasks = []
    for env in TASKS:
        scale, none = SCALES[env], np.zeros(n, dtype=bool)
        arms = tuple(
            scale.zero + (50 + shift + spread * STEPS[:n]) / scale.points for shift in (effects.get(env, 0.0), 0.0)
        )
        tasks.append(TaskSample(env, arms, (none, none), (0, 0), scale, None))
    if exclusion:
        tasks[-1] = replace(tasks[-1], exclusion=Exclusion(exclusion, ("x", "y")))
    return Sample("td3", claim, tuple(tasks))


def judged(*samples, rule=RULE):
    return judge_family([contrasts_of(one) for one in samples], rule)


def test_layer_one_is_the_mean_over_tasks_in_points_whatever_their_units():
    (one,) = judged(sample(hopper=10.0, ant=40.0))
    assert one.tested.pooled.estimate == pytest.approx(25.0)
    assert one.verdict is Verdict.SUPPORTED and one.stage is Stage.FINAL
    assert judged(sample(hopper=-10.0, ant=-40.0))[0].verdict is Verdict.CONTRADICTED
    assert judged(sample(hopper=0.1, ant=0.1, spread=20.0))[0].verdict is Verdict.UNDECIDED


def test_holm_runs_over_all_claims_of_the_family_also_those_that_cannot_be_tested():
    small, untested = sample("small", hopper=3.0, ant=3.0), sample("none")
    untested = replace(
        untested, tasks=tuple(replace(t, exclusion=Exclusion(Reason.NO_RUNS, ())) for t in untested.tasks)
    )
    alone, among = judged(small)[0], judged(small, *[untested] * 4)[0]
    assert among.adjusted_p == pytest.approx(5 * alone.adjusted_p)
    assert judged(untested)[0].verdict is Verdict.NOT_TESTABLE
    family = [sample(str(k), hopper=k, ant=k) for k in range(5)]
    p = [one.tested.pooled.p for one in judged(*family)]
    assert [one.adjusted_p for one in judged(*family)] == pytest.approx(multipletests(p, method="holm")[1])


def test_rows_have_verdicts_only_behind_the_gate_and_holm_runs_over_those_rows():
    decided = sample("decided", hopper=20.0, ant=4.0)
    hidden = sample("hidden", hopper=40.0, ant=-40.0)  # two true effects that cancel: layer 1 is undecided
    first, second = judged(decided, hidden)
    assert second.verdict is Verdict.UNDECIDED and [row.verdict for row in second.rows] == [None, None]
    hopper, ant = (scipy.stats.ttest_ind(*task.arms, equal_var=False).pvalue for task in decided.tasks)
    assert [row.adjusted_p for row in first.rows] == pytest.approx([2 * hopper, ant])
    assert [row.verdict for row in first.rows] == [Verdict.SUPPORTED, Verdict.UNDECIDED]


def test_every_task_needs_the_weakest_task():
    (strong,) = judged(sample(hopper=20.0, ant=20.0))
    assert strong.every_task is Verdict.SUPPORTED
    (weak,) = judged(sample(hopper=40.0, ant=3.0))
    assert weak.verdict is Verdict.SUPPORTED and weak.every_task is Verdict.UNDECIDED
    hopper = scipy.stats.ttest_ind(*sample(ant=3.0).tasks[1].arms, equal_var=False, alternative="greater").pvalue
    assert weak.every_task_p == pytest.approx(2 * hopper)
    (mixed,) = judged(sample(hopper=80.0, ant=-20.0))
    assert mixed.verdict is Verdict.SUPPORTED and mixed.every_task is Verdict.CONTRADICTED
    (part,) = judged(sample(hopper=20.0, ant=20.0, exclusion=Reason.NO_RUNS))
    assert part.verdict is Verdict.SUPPORTED and part.every_task is Verdict.NOT_TESTABLE


def test_no_relevant_difference_is_the_ninety_percent_interval_inside_the_smallest_effect():
    (equal,) = judged(sample(hopper=0.5, ant=0.5))
    assert equal.verdict is Verdict.UNDECIDED and equal.equal is True
    (small,) = judged(sample(hopper=6.0, ant=6.0))
    assert small.verdict is Verdict.SUPPORTED and small.equal is True  # smaller than relevant
    (wide,) = judged(sample(spread=40.0))
    assert wide.verdict is Verdict.UNDECIDED and wide.equal is False
    assert wide.equal_p > 0.05


def test_before_the_plan_is_done_layer_one_alone_is_judged_at_the_interim_alpha():
    (one,) = judged(sample(n=6, hopper=12.0, ant=12.0, spread=18.0))
    assert 0.001 < one.adjusted_p < 0.05
    assert one.stage is Stage.INTERIM and one.verdict is Verdict.UNDECIDED
    (strong,) = judged(sample(n=6, hopper=60.0, ant=60.0))
    assert strong.verdict is Verdict.SUPPORTED
    assert [row.verdict for row in strong.rows] == [None, None]
    assert strong.equal is None and strong.every_task is None


def test_a_planned_task_that_is_missing_keeps_the_claim_interim():
    whole = sample(hopper=20.0, ant=20.0, spread=18.0)
    first, second = whole.tasks
    none = replace(second, arms=(np.array([]),) * 2, exclusion=Exclusion(Reason.NO_RUNS, ("x", "y")))
    half, planned = replace(whole, tasks=(first, none)), replace(RULE, tasks_planned=True)
    (free,) = judged(half)  # the project's file: its tasks are no plan
    assert free.stage is Stage.FINAL and free.verdict is Verdict.SUPPORTED
    (one,) = judged(half, rule=planned)
    assert one.stage is Stage.INTERIM and one.tested.n == 10
    assert one.equal is None and one.every_task is None
    assert one.adjusted_p == free.adjusted_p and one.verdict is Verdict.UNDECIDED
    (strong,) = judged(replace(sample(hopper=60.0), tasks=(sample(hopper=60.0).tasks[0], none)), rule=planned)
    assert strong.verdict is Verdict.SUPPORTED and [row.verdict for row in strong.rows] == [None, None]
    assert judged(whole, rule=planned)[0].stage is Stage.FINAL


def test_fewer_than_five_seeds_are_not_judged_but_estimated():
    (one,) = judged(sample(n=4, hopper=60.0, ant=60.0, spread=1.0))
    assert one.verdict is Verdict.TOO_FEW_SEEDS and one.stage is Stage.TOO_FEW and np.isnan(one.adjusted_p)
    assert one.tested.pooled.estimate == pytest.approx(60.0) and one.tested.pooled.low > 0


def test_n_is_the_least_number_of_seeds_in_any_arm_of_any_task():
    one = sample(hopper=60.0, ant=60.0)
    first, second = one.tasks
    short = replace(
        second, arms=(second.arms[0][:7], second.arms[1]), diverged=(second.diverged[0][:7], second.diverged[1])
    )
    (result,) = judged(replace(one, tasks=(first, short)))
    assert result.tested.n == 7 and result.stage is Stage.INTERIM


def test_arms_without_variance_are_not_tested():
    assert judged(sample(spread=0.0, hopper=60.0))[0].verdict is Verdict.NOT_TESTABLE


def test_a_task_without_a_reference_is_a_row_but_no_part_of_the_pooled_effect():
    (one,) = judged(sample(hopper=20.0, ant=500.0, exclusion=Reason.NO_REFERENCE_SCORE))
    assert one.tested.pooled.estimate == pytest.approx(20.0)
    assert [row.verdict for row in one.rows] == [Verdict.SUPPORTED] * 2
