"""SIGTERM and SIGINT on real runs: exit 75, the manifest says so, the same command goes on to the same end."""

from __future__ import annotations

import shutil
import signal
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from src.training import session
from tests.end_to_end.commands import (
    AAN,
    Forked,
    assert_same_end,
    forked,
    manifest,
    newest_checkpoint,
    run_of,
    wait_for,
)
from tests.gate import close_gate, waiting


def test_sigterm(interrupted: Path, reference: Path, tmp_path: Path) -> None:
    results = shutil.copytree(interrupted, tmp_path / "copy")
    stopped = manifest(results)
    assert stopped["status"] == "interrupted"
    assert stopped["step"] == stopped["checkpoint_step"] == newest_checkpoint(results) < 450
    code, output = forked(results, *AAN)
    assert code == 0 and f"resumed at step {stopped['step']}" in output, output
    assert manifest(results)["times_resumed"] == 1
    assert_same_end(results, reference)


def test_one_sigint_takes_a_checkpoint(reference: Path, tmp_path: Path) -> None:
    """The checkpoint interval is the whole run, so only the signal can have made one."""
    command = (*AAN, "protocol.checkpoint_interval=450")
    results = tmp_path / "results"
    process = Forked(results, *command, prepare=partial(close_gate, str(tmp_path), 100))
    assert wait_for(lambda: waiting(tmp_path, 0), process), process.output
    process.signal(signal.SIGINT)
    assert process.wait() == 75, process.output
    assert manifest(results)["status"] == "interrupted" and newest_checkpoint(results) == 150
    code, output = forked(results, *command)
    assert code == 0 and "resumed at step" in output, output
    assert_same_end(results, reference)


def test_a_second_sigint_stops_at_once(tmp_path: Path) -> None:
    """The first evaluation does not end: after the first signal the run goes on with it."""
    results = tmp_path / "results"
    process = Forked(results, *AAN, prepare=partial(evaluate_for_ever, str(tmp_path)))
    for step in ("evaluating", "asked to stop"):
        assert wait_for((tmp_path / step).exists, process), process.output
        assert process.alive, process.output
        process.signal(signal.SIGINT)
    assert process.wait() == 130, process.output
    assert manifest(results)["status"] == "interrupted"
    assert newest_checkpoint(results) == -1 and not (run_of(results) / "evaluations.csv").exists()


def evaluate_for_ever(folder: str) -> None:
    """In the training process: no evaluation ends; files tell how far it is."""
    train = session.train

    def training(config: Any, run: Any, progress: Any, stop_requested: Callable[[], bool]) -> Any:
        def evaluate(*_: Any) -> None:
            (Path(folder) / "evaluating").touch()
            while True:
                time.sleep(0.01)
                if stop_requested():
                    (Path(folder) / "asked to stop").touch()

        session.Evaluator.evaluate = evaluate  # type: ignore[method-assign]
        return train(config, run, progress, stop_requested)

    session.train = training  # type: ignore[assignment]
