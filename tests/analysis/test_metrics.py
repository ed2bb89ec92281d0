"""If these fail, a printed number does not mean what its caption says."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from analysis import metrics

STEPS = np.array([0, 10, 20, 30])
# seed 0: 0 4 2 6; seed 1: 2 8 10 4
RETURNS = np.array([[0.0, 4.0, 2.0, 6.0], [2.0, 8.0, 10.0, 4.0]])
finite = st.floats(-1e5, 1e5)
matrices = st.tuples(st.integers(1, 6), st.integers(1, 12)).flatmap(lambda shape: arrays(float, shape, elements=finite))


def test_mean_curve_by_hand():
    curve = metrics.mean_curve(RETURNS)
    assert curve.mean.tolist() == [1, 6, 6, 5]
    assert curve.std == pytest.approx([2**0.5, 8**0.5, 32**0.5, 2**0.5])  # ddof=1: |a - b| / sqrt(2)
    assert curve.n.tolist() == [2, 2, 2, 2]


def test_half_std_by_hand_and_absent_for_one_seed():
    assert metrics.half_std(RETURNS)[2] == pytest.approx(32**0.5 / 2)
    assert np.isnan(metrics.half_std(RETURNS[:1])).all()


def test_both_readings_of_the_maximum_by_hand():
    of_mean = metrics.max_of_mean(STEPS, RETURNS)
    assert (of_mean.value, of_mean.std, of_mean.step) == (
        6.0,
        pytest.approx(8**0.5),
        10,
    )  # the first of two equal steps
    of_max = metrics.mean_of_max(RETURNS)
    assert (of_max.value, of_max.std) == (8.0, pytest.approx(8**0.5))  # maxima 6 and 10
    assert np.isnan(of_max.step)


def test_maximum_of_one_seed_has_no_spread():
    assert np.isnan(metrics.max_of_mean(STEPS, RETURNS[:1]).std)
    assert np.isnan(metrics.mean_of_max(RETURNS[:1]).std)


def test_max_of_mean_takes_only_steps_that_every_seed_has():
    ragged = np.array([[0.0, 4.0, 2.0, 6.0], [2.0, 8.0, 10.0, np.nan]])
    ragged[0, 3] = 1000.0  # would win as a "mean" over one seed
    assert metrics.max_of_mean(STEPS, ragged).value == 6.0
    assert np.isnan(metrics.max_of_mean(STEPS[:2], np.array([[1.0, np.nan], [np.nan, 2.0]])).value)


def test_final_performance_is_the_last_tenth_of_the_steps():
    steps = np.arange(0, 101, 5)
    returns = np.tile(steps.astype(float), (2, 1))
    returns[1] += 1
    # 90 is not later than 90% of 100: steps 95 and 100
    assert metrics.final_performance(steps, returns, 100).tolist() == [97.5, 98.5]


def test_smoothing_by_hand_centred_and_shortened_on_both_sides():
    assert metrics.smooth(np.array([0.0, 3.0, 6.0, 0.0, 9.0]), 3).tolist() == [0, 3, 3, 5, 9]
    assert metrics.smooth(np.array([0.0, 3.0, 6.0, 0.0, 9.0]), 5).tolist() == [0, 3, 3.6, 5, 9]
    assert metrics.smooth(np.array([1.0, np.nan, 3.0]), 3).tolist() == [1, 2, 3]


@pytest.mark.parametrize("window", [0, 4, -1])
def test_smoothing_refuses_a_window_without_a_centre(window):
    with pytest.raises(ValueError, match="odd"):
        metrics.smooth(np.zeros(3), window)


def test_hedges_g_by_hand():
    a, b = np.array([1.0, 2.0, 3.0]), np.array([3.0, 4.0, 5.0])
    assert metrics.hedges_g(a, b) == pytest.approx(-2 * (1 - 3 / 15))  # s = 1, df = 4
    assert np.isnan(metrics.hedges_g(a, np.array([1.0])))
    assert np.isnan(metrics.hedges_g(np.ones(3), np.zeros(3)))


@given(matrices)
def test_mean_of_max_is_never_below_max_of_mean(returns):
    steps = np.arange(returns.shape[1])
    assert metrics.mean_of_max(returns).value >= metrics.max_of_mean(steps, returns).value - 1e-6


@pytest.mark.parametrize(("evaluations", "window"), [(1, 3), (11, 3), (21, 3), (51, 5), (101, 11), (201, 21)])
def test_the_window_is_a_tenth_of_the_evaluations_and_odd(evaluations, window):
    assert metrics.smoothing_window(evaluations) == window


@given(matrices, finite)
def test_shifting_all_returns_shifts_means_and_leaves_spreads(returns, shift):
    steps, moved = np.arange(returns.shape[1]), returns + shift
    scale = 1 + np.abs(returns).max() + abs(shift)
    for f in (lambda r: metrics.max_of_mean(steps, r).value, lambda r: metrics.mean_of_max(r).value):
        assert f(moved) == pytest.approx(f(returns) + shift, abs=1e-9 * scale)
    assert metrics.mean_curve(moved).std == pytest.approx(
        metrics.mean_curve(returns).std, abs=1e-6 * scale, nan_ok=True
    )
    assert metrics.smooth(moved[0], 11) == pytest.approx(metrics.smooth(returns[0], 11) + shift, abs=1e-9 * scale)


@given(matrices, st.randoms())
def test_the_order_of_seeds_does_not_matter(returns, random):
    order = list(range(len(returns)))
    random.shuffle(order)
    steps = np.arange(returns.shape[1])
    assert metrics.mean_of_max(returns[order]).value == pytest.approx(metrics.mean_of_max(returns).value)
    assert metrics.mean_curve(returns[order]).mean == pytest.approx(metrics.mean_curve(returns).mean, abs=1e-6)
    assert sorted(metrics.final_performance(steps, returns[order], 11)) == pytest.approx(
        sorted(metrics.final_performance(steps, returns, 11)), nan_ok=True
    )


@given(arrays(float, 30, elements=finite))
def test_smoothing_stays_within_the_values_and_keeps_a_constant(values):
    smoothed = metrics.smooth(values, 11)
    assert smoothed.min() >= values.min() - 1e-6 and smoothed.max() <= values.max() + 1e-6
    assert metrics.smooth(np.full(30, values[0]), 11) == pytest.approx(np.full(30, values[0]))
