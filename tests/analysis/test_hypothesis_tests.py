"""If these fail, a p-value, an interval or a number of seeds is wrong."""

import math

import numpy as np
import pytest
import scipy.stats
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from statsmodels.stats.multitest import multipletests
from statsmodels.stats.power import TTestIndPower

from analysis.hypothesis_tests import (
    detectable_effect,
    holm,
    one_sided_p,
    power,
    seeds_for_effect,
    spread_within,
    t_interval,
    welch_contrast,
)

GENERATOR = np.random.default_rng(0)
samples = st.lists(st.floats(-1e3, 1e3), min_size=5, max_size=8).map(np.array)


@settings(max_examples=50, deadline=None)
@given(samples, samples)
def test_two_arms_are_welchs_test_as_scipy_has_it(a, b):
    assume(a.std() > 1e-5 or b.std() > 1e-5)
    ours = welch_contrast([a, b], (1, -1))
    theirs = scipy.stats.ttest_ind(a, b, equal_var=False)
    interval = theirs.confidence_interval(0.95)
    assert ours.p == pytest.approx(theirs.pvalue, rel=1e-6, abs=1e-12)
    assert ours.df == pytest.approx(theirs.df)
    assert (ours.low, ours.high) == pytest.approx((interval.low, interval.high), rel=1e-6, abs=1e-6)
    greater = scipy.stats.ttest_ind(a, b, equal_var=False, alternative="greater")
    assert one_sided_p(ours) == pytest.approx(greater.pvalue, rel=1e-6, abs=1e-12)


def test_interaction_by_hand():
    both, first, second, neither = (np.array([m - 2.0, m - 1, m, m + 1, m + 2]) for m in (10, 4, 3, 1))
    contrast = welch_contrast([both, first, second, neither], (1, -1, -1, 1))
    assert contrast.estimate == 10 - 4 - 3 + 1
    # every variance is 2.5, n = 5: SE^2 = 4 * 0.5 = 2; df = 2^2 / (4 * 0.5^2 / 4) = 16
    assert contrast.df == pytest.approx(16) and contrast.error == pytest.approx(2**0.5)
    assert contrast.p == pytest.approx(2 * scipy.stats.t.sf(4 / 2**0.5, 16))


def test_pooled_over_two_tasks_by_hand():
    # task 1: mean 6 against 1, variances 2.5 and 10, n = 5; task 2: mean 0 against 2, variances 2.5, n = 5
    steps = np.array([-2.0, -1, 0, 1, 2])
    arms = [6 + steps, 1 + 2 * steps, steps, 2 + steps]
    contrast = welch_contrast(arms, (0.5, -0.5, 0.5, -0.5))
    assert contrast.estimate == pytest.approx((5 - 2) / 2)
    # parts: 0.25 * (0.5, 2, 0.5, 0.5) = 0.125, 0.5, 0.125, 0.125; SE^2 = 0.875
    assert contrast.error == pytest.approx(0.875**0.5)
    assert contrast.df == pytest.approx(0.875**2 / ((3 * 0.125**2 + 0.5**2) / 4))
    half = scipy.stats.t.ppf(0.975, contrast.df) * 0.875**0.5
    assert (contrast.low, contrast.high) == pytest.approx((1.5 - half, 1.5 + half))


def test_interaction_equals_the_regression_with_equal_variances():
    import statsmodels.api as sm

    arms = [GENERATOR.normal(m, 1, 6) for m in (5, 3, 2, 1)]
    # the same variance in all: then Welch's is the pooled test
    arms = [(arm - arm.mean()) / arm.std(ddof=1) + mean for arm, mean in zip(arms, (5, 3, 2, 1))]
    x = np.repeat([[1, 1, 1, 1], [1, 1, 0, 0], [1, 0, 1, 0], [1, 0, 0, 0]], 6, axis=0)
    fit = sm.OLS(np.concatenate(arms), x).fit()
    assert welch_contrast(arms, (1, -1, -1, 1)).p == pytest.approx(fit.pvalues[3])


def test_under_five_seeds_there_is_an_interval_but_no_test_and_under_three_neither():
    five, four, two = np.arange(5.0), np.arange(4.0), np.arange(2.0)
    contrast = welch_contrast([four, five], (1, -1))
    assert math.isnan(contrast.p) and contrast.low < -0.5 < contrast.high
    assert math.isnan(one_sided_p(contrast))
    contrast = welch_contrast([two, five], (1, -1))
    assert contrast.estimate == -1.5 and np.isnan([contrast.low, contrast.high, contrast.p]).all()
    assert math.isnan(welch_contrast([np.array([]), five], (1, -1)).estimate)


def test_rounding_is_no_variance():
    ones = np.full(5, 3000.0)
    assert math.isnan(welch_contrast([ones, np.zeros(5)], (1, -1)).p)
    rounded = ones + 1e-7 * np.arange(5)
    assert math.isnan(welch_contrast([rounded, np.zeros(5)], (1, -1)).p)
    assert not math.isnan(welch_contrast([ones + 1e-3 * np.arange(5), np.zeros(5)], (1, -1)).p)


def test_holm_by_hand_and_by_statsmodels():
    # sorted 0.01, 0.02, 0.04, 1 -> 0.04, 0.06, 0.08, 1: what cannot be tested counts with p = 1
    assert holm([0.04, np.nan, 0.01, 0.02]) == pytest.approx([0.08, np.nan, 0.04, 0.06], nan_ok=True)
    p = GENERATOR.uniform(0, 0.2, 20)
    assert holm(p) == pytest.approx(multipletests(p, method="holm")[1])
    assert np.isnan(holm([np.nan])).all() and len(holm([])) == 0


@pytest.mark.parametrize(("effect", "n"), [(0.5, 3), (0.5, 40), (1.3, 3), (1.3, 10), (3.1, 3), (3.1, 10)])
def test_power_as_statsmodels_has_it(effect, n):
    theirs = TTestIndPower().power(effect, n, 0.05)
    assert power(n, effect, 1.0, (1, -1), 0.05) == pytest.approx(theirs, abs=1e-6)


@pytest.mark.parametrize("effect", [2.0, 5.0, 20.0, 100.0])
def test_power_is_one_where_scipys_noncentral_t_gives_up(effect):
    values = [power(n, effect, 1.0, (1, -1), 0.05) for n in (20, 40, 100, 1000, 10_000)]
    assert values == pytest.approx([1.0] * 5, abs=1e-3)


def test_seeds_for_an_effect_are_the_fewest_that_suffice():
    weights = (0.5, -0.5, 0.5, -0.5)
    n = seeds_for_effect(0.5, 1.0, weights)
    assert power(n, 0.5, 1.0, weights, 0.05) >= 0.8 > power(n - 1, 0.5, 1.0, weights, 0.05)
    assert seeds_for_effect(0.5, 1.0, weights, 0.05 / 5) > n
    assert seeds_for_effect(100.0, 1.0, weights) == 5  # never fewer than the rule takes
    assert seeds_for_effect(1e-6, 1.0, weights) is None  # beyond ten thousand
    assert seeds_for_effect(1.0, float("nan"), weights) is None and seeds_for_effect(1.0, 0.0, weights) is None


def test_spread_within_arms_ignores_the_differences_between_them():
    # sums of squares 2 and 8, degrees of freedom 2 and 2
    assert spread_within([np.array([9.0, 10, 11]), np.array([98.0, 100, 102])]) == pytest.approx((10 / 4) ** 0.5)
    assert math.isnan(spread_within([np.array([1.0]), np.array([2.0])]))


def test_t_interval_by_hand():
    # mean 3, standard deviation 1.58, n = 5, t(4) = 2.776
    assert t_interval(np.arange(1.0, 6)) == pytest.approx((3 - 1.9634, 3 + 1.9634), abs=1e-3)
    assert np.isnan(t_interval(np.array([1.0, 2.0]))).all()


@pytest.mark.parametrize(("n", "alpha", "effect"), [(10, 0.05, 1.3), (10, 0.05 / 8, 1.8), (3, 0.05, 3.1)])
def test_detectable_effects_of_a_single_pair(n, alpha, effect):
    assert detectable_effect(n, (1, -1), alpha, 0.8) == pytest.approx(effect, abs=0.06)
