"""If these fail, a printed interval is not that of the mean, or a command plays another policy than it says."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from src import evaluate
from src.config.schema import ConfigurationError
from src.policies.command import BEST, policy_path


def test_the_summary_is_mean_deviation_and_t_interval() -> None:
    returns = [10.0, 12.0, 17.0, 9.0]
    low, high = stats.t.interval(0.95, 3, np.mean(returns), stats.sem(returns))
    text = evaluate.statistics(returns)
    assert "mean return 12.0 over 4 episodes" in text and f"standard deviation {np.std(returns, ddof=1):.1f}" in text
    assert f"95% t interval of the mean {low:.1f} to {high:.1f}" in text


def test_one_episode_has_a_mean_only() -> None:
    assert evaluate.statistics([3.0]) == "mean return 3.0 over 1 episode"


def test_best_is_another_file_and_never_the_final_one_in_silence(tmp_path: Path) -> None:
    (tmp_path / "policy.pt").touch()
    assert policy_path(tmp_path) == tmp_path / "policy.pt"
    with pytest.raises(ConfigurationError, match="keep_best=true"):
        policy_path(tmp_path, BEST)
    (tmp_path / "policy_best.pt").touch()
    assert policy_path(tmp_path, BEST) == tmp_path / "policy_best.pt"
    assert policy_path(tmp_path / "policy_best.pt") == tmp_path / "policy_best.pt"


def test_the_command_plays_the_policy_asked_for(tiny_run: Path, tmp_path: Path) -> None:
    def returns(*arguments: str) -> list[str]:
        path = tmp_path / "episodes.csv"
        assert evaluate.main([str(tiny_run), "--episodes", "2", "--csv", str(path), *arguments]) == 0
        return [row["return"] for row in csv.DictReader(path.open())]

    final, best = returns(), returns("--policy", "best")
    assert final == returns("--policy", "final")
    assert (final == best) == ((tiny_run / "policy.pt").read_bytes() == (tiny_run / "policy_best.pt").read_bytes())


@pytest.mark.parametrize("arguments", [["--policy", "best", "--operations"], ["--episodes", "0"], ["--seed", "-1"]])
def test_nonsense_is_refused(tmp_path: Path, arguments: list[str]) -> None:
    with pytest.raises(SystemExit):
        evaluate.parse([str(tmp_path), *arguments])
