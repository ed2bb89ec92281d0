"""If these fail, the report says that an actor fails more or less often than its runs do."""

import math

import numpy as np
import pytest
import scipy.stats
from statsmodels.stats.proportion import confint_proportions_2indep, proportion_confint

from analysis.failure_rates import difference, failures, rate


def test_a_run_fails_below_the_threshold_and_not_at_it():
    assert failures(np.array([49.9, 50.0, 120.0, -3.0]), 50.0) == 2


def test_the_interval_is_exact():
    assert rate(0, 10)[1:] == pytest.approx((0, 1 - 0.025**0.1))
    assert rate(3, 10)[1:] == pytest.approx(proportion_confint(3, 10, method="beta"))
    assert math.isnan(rate(0, 0).share)


def test_one_task_is_newcombes_interval_and_mantel_haenszel_by_hand():
    found, p = difference([(1, 6)], [(10, 10)])
    assert found.share == pytest.approx(-0.5)
    assert (found.low, found.high) == pytest.approx(confint_proportions_2indep(1, 10, 6, 10, method="newcomb"))
    # expected 3.5, variance 10 * 10 * 7 * 13 / (20^2 * 19); |1 - 3.5| - 0.5 = 2
    statistic = 2**2 / (10 * 10 * 7 * 13 / (400 * 19))
    assert p == pytest.approx(scipy.stats.chi2.sf(statistic, 1))


def test_over_two_tasks_by_hand():
    # expected 3.5 and 1; variances 1.19737 and 0.473684; |1 + 0 - 4.5| - 0.5 = 3
    found, p = difference([(1, 6), (0, 2)], [(10, 10), (10, 10)])
    assert found.share == pytest.approx((-0.5 - 0.2) / 2)
    variance = 10 * 10 * 7 * 13 / (400 * 19) + 10 * 10 * 2 * 18 / (400 * 19)
    assert p == pytest.approx(scipy.stats.chi2.sf(3**2 / variance, 1))
    one, two = (confint_proportions_2indep(*counts, method="newcomb") for counts in ((1, 10, 6, 10), (0, 10, 2, 10)))
    assert found.low == pytest.approx(-0.35 - np.hypot(-0.5 - one[0], -0.2 - two[0]) / 2)
    assert found.high == pytest.approx(-0.35 + np.hypot(one[1] + 0.5, two[1] + 0.2) / 2)


def test_no_test_without_failures_or_with_few_seeds_but_an_estimate():
    assert math.isnan(difference([(0, 0)], [(10, 10)])[1]) and difference([(0, 0)], [(10, 10)])[0].share == 0
    assert math.isnan(difference([(1, 4)], [(4, 10)])[1])
    assert difference([(1, 6), (0, 0)], [(10, 10), (10, 10)])[1] == difference([(1, 6)], [(10, 10)])[1]
