"""If these fail, the policy that a user replays is not the policy that was evaluated."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest
import torch

from src.streams import Streams
from src.training.checkpoint import CorruptState
from src.training.evaluation import Evaluator
from src.training.policy_file import TrainedPolicy
from tests.helpers import tiny
from tests.training.test_session import run


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return run(tiny(tmp_path_factory.mktemp("policy"), algo="sac", actor="bptsan"))[1]


def test_the_policy_file_alone_replays_the_last_evaluation(finished: Path) -> None:
    trained = TrainedPolicy(finished / "policy.pt")
    table = pd.read_csv(finished / "evaluations.csv")
    last = table[table["step"] == table["step"].max()]
    act, step = trained.on_training_backend(), int(last["step"].iloc[0])
    again = Evaluator(trained.config.env, 2, Streams(trained.config.seed)).evaluate(act, step)
    assert [r for r, _ in again] == last["return"].tolist()


def test_a_policy_that_is_changed_acts_by_what_it_is_then(finished: Path) -> None:
    """Whoever disturbs weights asks for the acting again; the plain path needs no asking."""
    trained = TrainedPolicy(finished / "policy.pt")
    observation, generator = torch.randn(5, 11), torch.Generator()
    before = trained.on_training_backend()(observation, generator.manual_seed(1))
    torch.testing.assert_close(before, trained.act(observation, generator.manual_seed(1)), rtol=0, atol=1e-3)
    with torch.no_grad():
        trained.policy.actor.decoder.bias += 1.0  # type: ignore[union-attr,operator]
    after = trained.on_training_backend()(observation, generator.manual_seed(1))
    torch.testing.assert_close(after, trained.act(observation, generator.manual_seed(1)), rtol=0, atol=1e-3)
    assert (after > before).all()


def test_no_path_of_the_machine_is_carried_away(finished: Path) -> None:
    assert str(finished.parents[6]).encode() not in (finished / "policy.pt").read_bytes()


def test_the_command_plays_fresh_episodes_the_same_ones_each_time(finished: Path) -> None:
    command = [sys.executable, "-m", "src.evaluate", str(finished), "--episodes", "2"]
    first = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    second = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    assert "mean return" in first and first == second


def test_a_run_without_a_policy_is_one_sentence(tmp_path: Path) -> None:
    result = subprocess.run([sys.executable, "-m", "src.evaluate", str(tmp_path)], capture_output=True, text=True)
    assert result.returncode == 2
    assert "no trained policy" in result.stderr and "Traceback" not in result.stderr


def test_a_cut_policy_file_is_refused(finished: Path, tmp_path: Path) -> None:
    cut = tmp_path / "policy.pt"
    cut.write_bytes((finished / "policy.pt").read_bytes()[:-1])
    with pytest.raises(CorruptState, match="truncated"):
        TrainedPolicy(cut)
