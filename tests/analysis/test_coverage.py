"""If these fail, a caption quotes the coverage of another interval than it shows."""

import pytest

from analysis import coverage


def test_a_caption_gives_the_least_and_the_most_over_laws_and_intervals(monkeypatch):
    content = {"a": {3: (70, 80), 5: (85, 90)}, "b": {3: (75, 95), 5: (80, 88)}}
    monkeypatch.setattr(coverage, "intervals", lambda: content)
    assert coverage.coverage("a") == "70–80 / 85–90% of the time at 3 / 5 seeds"
    assert coverage.covers("a", "b") == (
        "Simulated, such an interval covers the truth 70–95 / 80–90% of the time at 3 / 5 seeds."
    )
    with pytest.raises(KeyError):
        coverage.covers("c")


def test_welchs_intervals_keep_what_they_promise_and_few_seeds_bootstrap_intervals_do_not():
    found = coverage.intervals()
    assert all(low >= 94 for name in ("pooled", "difference") for low, _ in found[name].values())
    assert found["iqm of one task"][3][1] < 85 and "69–75" in coverage.few_seeds()
