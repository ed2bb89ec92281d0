"""If these fail, a p-value, an interval or a verdict is wrong."""

import numpy as np
import pytest
import scipy.stats
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from statsmodels.stats.power import TTestIndPower

from analysis.tests_of_claims import (
    detectable_effect,
    holm,
    power,
    seeds_for_power,
    t_interval,
    verdict,
    welch_contrast,
)

GENERATOR = np.random.default_rng(0)
samples = st.lists(st.floats(-1e3, 1e3), min_size=3, max_size=8).map(np.array)


@settings(max_examples=50, deadline=None)
@given(samples, samples)
def test_two_arms_are_welchs_test_as_scipy_has_it(a, b):
    assume(a.std() > 1e-6 or b.std() > 1e-6)
    ours = welch_contrast([a, b], (1, -1))
    theirs = scipy.stats.ttest_ind(a, b, equal_var=False)
    interval = theirs.confidence_interval(0.95)
    assert ours.p == pytest.approx(theirs.pvalue, rel=1e-6, abs=1e-12)
    assert ours.df == pytest.approx(theirs.df)
    assert (ours.low, ours.high) == pytest.approx((interval.low, interval.high), rel=1e-6, abs=1e-6)


def test_interaction_by_hand():
    both, first, second, neither = (np.array([m - 1.0, m, m + 1.0]) for m in (10, 4, 3, 1))
    contrast = welch_contrast([both, first, second, neither], (1, -1, -1, 1))
    assert contrast.estimate == 10 - 4 - 3 + 1
    # every variance is 1, n = 3: SE^2 = 4/3; df = (4/3)^2 / (4 (1/3)^2 / 2) = 8
    assert contrast.df == pytest.approx(8)
    assert contrast.p == pytest.approx(2 * scipy.stats.t.sf(4 / (4 / 3) ** 0.5, 8))


def test_interaction_equals_the_regression_with_equal_variances():
    import statsmodels.api as sm

    arms = [GENERATOR.normal(m, 1, 6) for m in (5, 3, 2, 1)]
    arms = [a - a.mean() + m for a, m in zip(arms, (5, 3, 2, 1))]
    arms = [
        (a - a.mean()) / a.std(ddof=1) + a.mean() for a in arms
    ]  # same variance in all: then Welch is the pooled test
    x = np.repeat([[1, 1, 1, 1], [1, 1, 0, 0], [1, 0, 1, 0], [1, 0, 0, 0]], 6, axis=0)
    fit = sm.OLS(np.concatenate(arms), x).fit()
    assert welch_contrast(arms, (1, -1, -1, 1)).p == pytest.approx(fit.pvalues[3])


def test_fewer_than_three_seeds_give_no_interval():
    contrast = welch_contrast([np.array([1.0, 2.0]), np.array([5.0, 6.0, 7.0])], (1, -1))
    assert contrast.estimate == -4.5 and np.isnan([contrast.low, contrast.high, contrast.p]).all()
    assert np.isnan(welch_contrast([np.array([]), np.ones(3)], (1, -1)).estimate)
    assert np.isnan(welch_contrast([np.ones(3), np.zeros(3)], (1, -1)).p)  # nothing varies: no test


def test_holm_by_hand():
    # sorted 0.01, 0.02, 0.04 -> 0.03, 0.04, 0.04; an untested row does not count
    assert holm(np.array([0.04, np.nan, 0.01, 0.02])) == pytest.approx([0.04, np.nan, 0.03, 0.04], nan_ok=True)
    assert np.isnan(holm(np.array([np.nan]))).all()


@pytest.mark.parametrize(("effect", "n"), [(0.5, 3), (0.5, 40), (1.3, 3), (1.3, 10), (3.1, 3), (3.1, 10)])
def test_power_as_statsmodels_has_it(effect, n):
    theirs = TTestIndPower().power(effect, n, 0.05)
    assert power(n, effect, np.array([1.0, 1.0]), (1, -1), 0.05) == pytest.approx(theirs, abs=1e-6)


@pytest.mark.parametrize("effect", [2.0, 5.0, 20.0, 100.0])
def test_power_is_one_where_scipys_noncentral_t_gives_up(effect):
    values = [power(n, effect, np.ones(2), (1, -1), 0.05) for n in (20, 40, 100, 1000, 10_000)]
    assert values == pytest.approx([1.0] * 5, abs=1e-3)


def test_methods_own_figures_for_power():
    ones = np.ones(2)
    assert power(10, 1.3, ones, (1, -1), 0.05) == pytest.approx(0.8, abs=0.02)
    assert power(10, 1.8, ones, (1, -1), 0.05 / 8) == pytest.approx(0.8, abs=0.02)
    assert power(3, 3.1, ones, (1, -1), 0.05) == pytest.approx(0.8, abs=0.02)


def test_seeds_for_power_is_the_smallest_that_suffices():
    a = np.array([-1.0, 0.0, 1.0])
    arms, weights = [a + 1, a], (1, -1)
    n = seeds_for_power(arms, weights)
    stds = np.ones(2)
    assert power(n, 1.0, stds, weights, 0.05) >= 0.8 > power(n - 1, 1.0, stds, weights, 0.05)
    assert seeds_for_power(arms, weights, 0.05 / 20) > n
    assert seeds_for_power([a, a], weights) is None  # no effect: no number of seeds
    assert seeds_for_power([a + 1e-6, a], weights) is None  # beyond ten thousand
    assert seeds_for_power([a + 100, a], weights) == 3  # never fewer than the rule takes


@pytest.mark.parametrize(
    ("p", "estimate", "expected"),
    [
        (0.049, 1, "supported"),
        (0.049, -1, "contradicted"),
        (0.05, 1, "undecided"),
        (0.5, 1, "undecided"),
        (float("nan"), 1, "undecided"),
    ],
)
def test_the_verdict_rule(p, estimate, expected):
    assert verdict(p, estimate) == expected


def test_t_interval_as_scipy_has_it():
    values = GENERATOR.normal(5, 2, 7)
    theirs = scipy.stats.ttest_1samp(values, 0).confidence_interval(0.95)
    assert t_interval(values) == pytest.approx((theirs.low, theirs.high))
    assert np.isnan(t_interval(values[:2])).all()


@pytest.mark.parametrize(("n", "alpha", "effect"), [(10, 0.05, 1.3), (10, 0.05 / 8, 1.8), (3, 0.05, 3.1)])
def test_detectable_effects_are_methods_own(n, alpha, effect):
    assert detectable_effect(n, alpha, 0.8) == pytest.approx(effect, abs=0.06)
