"""If these fail, actors are called equal that differ by more than the smallest relevant effect."""

import math

import numpy as np
import pytest
from statsmodels.stats.weightstats import CompareMeans, DescrStatsW

from analysis.verdicts.equality import equality_p, with_failure

GENERATOR = np.random.default_rng(0)


def test_one_more_failed_run_by_hand():
    # 1, 2, 3 and half a run at 0: n = 3.5, mean 6 / 3.5; squares 2 + 3 * 0.5 / 3.5 * 4
    counted = with_failure(np.array([1.0, 2, 3]), 0.5)
    assert counted == pytest.approx((3.5, 6 / 3.5, (2 + 3 * 0.5 / 3.5 * 4) / 2.5))
    # a whole run is the same as a fourth one
    four = np.array([1.0, 2, 3, 0])
    assert with_failure(four[:3], 1.0) == pytest.approx((4, four.mean(), four.var(ddof=1)))
    assert with_failure(np.array([-9.0, 2, 3]), 1.0).mean == pytest.approx(-13 / 4)  # at its own lowest


def test_it_is_statsmodels_two_one_sided_tests_of_arms_that_hold_the_failure():
    a, b = GENERATOR.normal(100, 1, 8), GENERATOR.normal(101, 2, 6)
    above = CompareMeans(DescrStatsW(a), DescrStatsW(np.append(b, 0.0))).ttost_ind(-60, 60, usevar="unequal")
    below = CompareMeans(DescrStatsW(np.append(a, 0.0)), DescrStatsW(b)).ttost_ind(-60, 60, usevar="unequal")
    assert equality_p([(a, b)], (1, -1), 60) == pytest.approx(max(above[1][1][1], below[1][0][1]))


@pytest.mark.parametrize("tasks", [1, 2])
def test_ten_steady_seeds_on_one_or_two_tasks_are_too_few_to_rule_out_failures(tasks):
    steady = [tuple(GENERATOR.normal(100, 1, 10) for _ in range(2)) for _ in range(tasks)]
    assert equality_p(steady, (1, -1), 15) > 0.05 / 5
    four = [tuple(GENERATOR.normal(100, 1, 10) for _ in range(2)) for _ in range(4)]
    assert equality_p(four, (1, -1), 15) < 0.05 / 5


def test_low_scores_have_little_to_lose():
    low = [tuple(GENERATOR.normal(10, 1, 10) for _ in range(2))]
    assert equality_p(low, (1, -1), 15) < 0.05 / 5


def test_no_test_below_five_seeds_or_without_variance():
    assert math.isnan(equality_p([(np.arange(4.0), np.arange(5.0))], (1, -1), 1e9))
    assert math.isnan(equality_p([(np.ones(5), np.ones(5))], (1, -1), 1.0)) and math.isnan(equality_p([], (1, -1), 1.0))
