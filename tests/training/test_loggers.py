"""Weights & Biases: one run per run directory, over its resumes, under a name that tells which. TensorBoard's events
after kills: ``tests/end_to_end/test_loggers.py``."""

from __future__ import annotations

import sys
import types
from pathlib import Path
from typing import Any

import pytest

from src.config.identity import Run
from src.config.schema import ConfigurationError
from src.experiment.ownership import acquire
from src.training.loggers import TensorBoard, open_logger
from src.training.session import TrainingSession
from tests.helpers import Silent, tiny

WANDB = {"logger": "wandb", "actor": "aan"}


class FakeRun:
    def __init__(self, wandb: FakeWandb, arguments: dict[str, Any]) -> None:
        self.wandb, self.arguments = wandb, arguments
        self.finished = False
        self.steps: list[int] = []
        self.keys: set[str] = set()

    def log(self, values: dict[str, float], step: int) -> None:
        self.steps.append(step)
        self.keys |= values.keys()

    def finish(self) -> None:
        self.finished = True


class FakeWandb(types.ModuleType):
    Error = RuntimeError

    def __init__(self) -> None:
        super().__init__("wandb")
        self.runs: list[FakeRun] = []

    def init(self, **arguments: Any) -> FakeRun:
        self.runs.append(FakeRun(self, arguments))
        return self.runs[-1]


@pytest.fixture
def wandb(monkeypatch: pytest.MonkeyPatch) -> FakeWandb:
    fake = FakeWandb()
    monkeypatch.setitem(sys.modules, "wandb", fake)
    return fake


def train(config: Any, stop_at: int | None = None) -> Path:
    with acquire(Run(config)) as (directory, _):
        session = TrainingSession(config, directory, Silent())
        session.loop(lambda: session.step == stop_at)
        return directory.path


def test_a_resumed_run_goes_on_under_its_own_id(tmp_path: Path, wandb: FakeWandb) -> None:
    config = tiny(tmp_path, **WANDB)
    train(config, stop_at=200)
    path = train(config)
    first, second = wandb.runs
    assert first.arguments["id"] == second.arguments["id"]
    assert all(run.arguments["resume"] == "allow" and run.finished for run in wandb.runs)
    assert first.arguments["dir"] == str(path / "state")
    assert [*first.steps, *second.steps] == [0, 150, 300, 450]
    assert "step" not in first.keys and "evaluation_return" in first.keys


def test_runs_are_told_apart_and_the_seeds_of_a_cell_are_a_group(tmp_path: Path, wandb: FakeWandb) -> None:
    cells = [(seed, env, label) for seed in (0, 1) for env in ("hopper", "ant") for label in ("aan", "aan-mine")]
    for seed, env, label in cells:
        with acquire(Run(tiny(tmp_path, {"seed": seed, "label": label}, env=env, **WANDB))) as (directory, _):
            open_logger(tiny(tmp_path, {"seed": seed, "label": label}, env=env, **WANDB), directory, 0)
    arguments = [run.arguments for run in wandb.runs]
    assert len({each["id"] for each in arguments}) == len({each["name"] for each in arguments}) == 8
    assert arguments[0]["name"] == "aan-hopper-seed_0"
    assert arguments[0]["group"] == "test/td3/hopper/aan/none"
    assert len({each["group"] for each in arguments}) == 4


def test_a_run_that_starts_over_is_another_one(tmp_path: Path, wandb: FakeWandb) -> None:
    train(tiny(tmp_path, **WANDB), stop_at=50)
    train(tiny(tmp_path, {"algo.discount": 0.9, "label": "aan", "on_conflict": "replace"}, **WANDB), stop_at=50)
    first, second = wandb.runs
    assert first.arguments["id"] != second.arguments["id"]


def test_a_refusal_is_one_sentence(tmp_path: Path, wandb: FakeWandb, monkeypatch: pytest.MonkeyPatch) -> None:
    def init(**_: Any) -> None:
        raise RuntimeError("api_key not configured (no-tty).\nmore")

    monkeypatch.setattr(wandb, "init", init)
    with acquire(Run(tiny(tmp_path, **WANDB))) as (directory, _):
        with pytest.raises(ConfigurationError, match=r"logger=wandb: api_key not configured.*logger.mode=offline"):
            open_logger(tiny(tmp_path, **WANDB), directory, 0)
        monkeypatch.setitem(sys.modules, "wandb", None)
        with pytest.raises(ConfigurationError, match=r"wandb is not installed"):
            open_logger(tiny(tmp_path, **WANDB), directory, 0)


def test_event_files_are_read_in_the_order_in_which_they_were_opened(tmp_path: Path) -> None:
    """Two starts within one second: their names would be told apart by process ids and counters, as text."""
    opened = []
    for step in (0, 10):
        TensorBoard(tmp_path, step).close()
        opened += [path.name for path in tmp_path.iterdir() if path.name not in opened]
    assert opened[0].split(".")[3] < opened[1].split(".")[3]


@pytest.mark.long
def test_real_wandb_offline(tmp_path: Path) -> None:
    """Two folders, one id; what ``wandb sync`` makes of them needs a server."""
    pytest.importorskip("wandb")
    config = tiny(tmp_path, **WANDB)
    train(config, stop_at=200)
    path = train(config)
    folders = sorted(folder.name for folder in (path / "state" / "wandb").glob("offline-run-*"))
    identifier = (path / "state" / "wandb-id").read_text()
    assert len(folders) == 2 and all(name.endswith(f"-{identifier}") for name in folders)
