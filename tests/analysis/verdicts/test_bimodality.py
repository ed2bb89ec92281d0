"""If these fail, a mean over failed and successful runs passes for a typical run, or every arm is called split."""

import numpy as np
import pytest

from analysis.verdicts.bimodality import bimodal, share_below_half


@pytest.mark.parametrize("n", [5, 10])
def test_failed_runs_split_an_arm_and_normal_spread_does_not(n):
    generator = np.random.default_rng(0)
    for spread in (15, 40):
        assert np.mean([bimodal(generator.normal(80, spread, n), 15) for _ in range(2000)]) < 0.08
    worked = generator.normal(95, 8, (500, n - n // 3))
    failed = generator.normal(5, 5, (500, n // 3))
    assert np.mean([bimodal(scores, 15) for scores in np.hstack([worked, failed])]) > 0.9


def test_a_gap_that_is_not_relevant_splits_nothing_and_four_seeds_are_too_few():
    assert not bimodal(np.array([80.0, 80.1, 90, 90.1, 90.2]), 15)
    assert not bimodal(np.array([0.0, 0, 100, 100]), 15)


def test_the_share_below_half_of_the_reference():
    assert share_below_half(np.array([49.9, 50.0, 120.0, -5.0])) == 0.5
    assert np.isnan(share_below_half(np.array([])))
