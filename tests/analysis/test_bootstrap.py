"""If these fail, an interval is not the stratified bootstrap's, or moves from run to run."""

import numpy as np
import pytest
import scipy.stats
from hypothesis import given, settings
from hypothesis import strategies as st
from rliable import library
from rliable import metrics as rliable_metrics

from analysis import bootstrap
from analysis.improvement import improvement_with_interval, probability_of_improvement

GENERATOR = np.random.default_rng(1)
SCORES = GENERATOR.normal([50, 60, 70, 80], [10, 5, 20, 10], size=(10, 4))
OTHER = SCORES - GENERATOR.normal(5, 8, size=(10, 4))
TASKS = list(SCORES.T)


def test_iqm_by_hand():
    # 8 pooled scores; a quarter cut at each end leaves 3, 4, 5, 6
    assert bootstrap.point([np.array([1.0, 2, 3, 4]), np.array([5.0, 6, 7, 100])], bootstrap.iqm) == 4.5


def test_iqm_cuts_exactly_a_quarter_of_the_weight_by_hand():
    # 5 equal runs: a quarter is a run and a quarter of the next; 0.75 of 2, all of 3, 0.75 of 7 are left
    assert bootstrap.point([np.array([1.0, 2, 3, 7, 90])], bootstrap.iqm) == pytest.approx((1.5 + 3 + 5.25) / 2.5)
    # task A: two runs of weight 1/4, task B: three of 1/6; sorted 0 (B), 1 (A), 2 (B), 3 (B), 8 (A)
    # cut: all of 0 and a third of 1; above, a quarter is exactly 8: left 1/6 of 1, 1/6 of 2, 1/6 of 3
    assert bootstrap.point([np.array([1.0, 8]), np.array([0.0, 2, 3])], bootstrap.iqm) == pytest.approx(2.0)


@pytest.mark.parametrize("runs", [4, 8, 12])
def test_iqm_is_scipys_trimmed_mean_where_the_runs_are_a_multiple_of_four(runs):
    scores = GENERATOR.normal(size=runs)
    assert bootstrap.point([scores], bootstrap.iqm) == pytest.approx(scipy.stats.trim_mean(scores, 0.25))


def test_points_equal_rliable():
    ours = {
        name: bootstrap.point(TASKS, f)
        for name, f in (("iqm", bootstrap.iqm), ("mean", bootstrap.mean), ("median", bootstrap.median))
    }
    assert ours["iqm"] == pytest.approx(rliable_metrics.aggregate_iqm(SCORES))
    assert ours["mean"] == pytest.approx(rliable_metrics.aggregate_mean(SCORES))
    assert ours["median"] == pytest.approx(rliable_metrics.aggregate_median(SCORES))
    gap = bootstrap.point(TASKS, bootstrap.optimality_gap)
    assert gap == pytest.approx(rliable_metrics.aggregate_optimality_gap(SCORES, gamma=100))


def test_intervals_agree_with_rliable():
    np.random.seed(0)
    functions = (bootstrap.iqm, rliable_metrics.aggregate_iqm), (bootstrap.median, rliable_metrics.aggregate_median)
    theirs = library.get_interval_estimates({"x": SCORES}, lambda s: np.array([f(s) for _, f in functions]), reps=2000)[
        1
    ]["x"]
    for column, (ours, _) in enumerate(functions):
        assert bootstrap.interval(TASKS, ours) == pytest.approx(
            theirs[:, column], abs=0.6
        )  # both are Monte Carlo; widths are about 8


def test_profile_agrees_with_rliable():
    thresholds = np.linspace(30, 100, 8)
    np.random.seed(0)
    theirs, theirs_interval = library.create_performance_profile({"x": SCORES}, thresholds, reps=1000)
    assert bootstrap.profile(TASKS, thresholds) == pytest.approx(theirs["x"])
    assert np.array(bootstrap.profile_interval(TASKS, thresholds)) == pytest.approx(theirs_interval["x"], abs=0.03)


def test_probability_of_improvement_by_hand():
    # pairs: 3>1, 3>2, 1=1, 1<2 -> (1 + 1 + 0.5 + 0) / 4
    x, y = np.array([3.0, 1.0]), np.array([1.0, 2.0])
    assert probability_of_improvement([x], [y]) == 0.625
    assert probability_of_improvement([x, np.array([9.0])], [y, np.array([1.0])]) == pytest.approx((0.625 + 1) / 2)


def test_probability_of_improvement_interval_agrees_with_rliable():
    np.random.seed(0)
    pairs = {"x,y": (SCORES, OTHER)}
    theirs = library.get_interval_estimates(pairs, rliable_metrics.probability_of_improvement, reps=500)[1][
        "x,y"
    ].ravel()
    assert bootstrap.improvement_interval(TASKS, list(OTHER.T)) == pytest.approx(theirs, abs=0.04)


def test_ties_count_half_in_the_interval_too():
    assert bootstrap.improvement_interval([np.ones(4)], [np.ones(3)]) == (0.5, 0.5)


def test_same_seed_same_interval_and_no_global_generator():
    np.random.seed(3)
    first = bootstrap.interval(TASKS, bootstrap.iqm, 500)
    state = np.random.get_state()[1].tolist()
    assert bootstrap.interval(TASKS, bootstrap.iqm, 500) == first
    assert np.random.get_state()[1].tolist() == state
    assert bootstrap.interval(TASKS, bootstrap.iqm, 500, seed=1) != first


def test_unequal_seeds_per_task():
    low, high = bootstrap.interval([SCORES[:, 0], SCORES[:4, 1], SCORES[:7, 2]], bootstrap.iqm)
    assert low < bootstrap.point([SCORES[:, 0], SCORES[:4, 1], SCORES[:7, 2]], bootstrap.iqm) < high


def test_a_task_without_seeds_is_refused():
    with pytest.raises(ValueError, match="at least one seed"):
        bootstrap.interval([SCORES[:, 0], np.array([])], bootstrap.iqm)


def test_curve_resamples_whole_runs():
    # every run is constant over time, so the interval must be the same at every step
    runs = np.repeat(SCORES[:, :1], 5, axis=1)
    _, low, high = bootstrap.curve_interval([runs], bootstrap.iqm, 300)
    assert np.ptp(low) == np.ptp(high) == 0 and low[0] < high[0]


@settings(max_examples=25, deadline=None)
@given(st.lists(st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=6), min_size=1, max_size=4))
def test_intervals_are_ordered_and_inside_the_data(tasks):
    values = [np.array(task) for task in tasks]
    low, high = bootstrap.interval(values, bootstrap.mean, 200)
    assert min(map(min, values)) - 1e-9 <= low <= high <= max(map(max, values)) + 1e-9


@settings(max_examples=25, deadline=None)
@given(st.lists(st.floats(-10, 10), min_size=1, max_size=6), st.lists(st.floats(-10, 10), min_size=1, max_size=6))
def test_improvement_and_its_converse_add_to_one(x, y):
    a, b = [np.array(x)], [np.array(y)]
    assert probability_of_improvement(a, b) + probability_of_improvement(b, a) == pytest.approx(1)


def test_tasks_weigh_the_same_whatever_their_number_of_seeds():
    # a task of 2 constant runs and one of 30: half of the weight is 0, half is 100
    unequal = [np.zeros(2), np.full(30, 100.0)]
    assert bootstrap.point(unequal, bootstrap.iqm) == pytest.approx(50)
    assert bootstrap.point(unequal, bootstrap.optimality_gap) == pytest.approx(50)
    # copying every run of one task must move nothing: 8 and 16 runs are both cut by a quarter at each end
    few, many = [TASKS[0][:8], TASKS[1][:8]], [TASKS[0][:8], np.repeat(TASKS[1][:8], 2)]
    assert bootstrap.point(many, bootstrap.iqm) == pytest.approx(bootstrap.point(few, bootstrap.iqm))
    assert bootstrap.point(many, bootstrap.optimality_gap) == pytest.approx(
        bootstrap.point(few, bootstrap.optimality_gap)
    )


def test_no_interval_of_improvement_at_complete_separation():
    a, b = np.array([3.0, 4.0, 5.0]), np.array([0.0, 1.0, 2.0])
    assert improvement_with_interval([a], [b]) == pytest.approx((1.0, np.nan, np.nan), nan_ok=True)
    value, low, high = improvement_with_interval([a, a], [b, np.array([0.0, 1.0, 4.5])])
    assert low < value < high
    assert np.isnan(improvement_with_interval([a[:2]], [np.array([0.0, 3.5])])[1])
