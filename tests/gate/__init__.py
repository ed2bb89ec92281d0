"""A gate in a training run: there it waits until the test opens it, or until it is asked to stop.

So that no test guesses how fast a machine trains: what is to happen "in mid-run" happens while the run waits. Each seed
has a gate of its own in a folder of the test's.
"""

from __future__ import annotations

import json
import os
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]


def close_gate(folder: str, step: int) -> None:
    """In the training process: let every run wait from environment step ``step`` on, behind each batch and checkpoint.

    One that resumes at that step or later waits before it begins, so that no kill lets it pass.
    """
    from src.training import session

    train = session.train

    def gated(config: Any, run: Any, progress: Any, stop_requested: Callable[[], bool]) -> Any:
        waiting = _Waiting(progress, Path(folder), config.seed, step, stop_requested)
        waiting.at(run.manifest.checkpoint_step or 0)
        return train(config, run, waiting, stop_requested)

    session.train = gated  # type: ignore[assignment]


def environment(folder: Path, step: int) -> dict[str, str]:
    """For a command whose jobs are to find a closed gate (``sitecustomize.py`` beside this file closes it)."""
    here = str(Path(__file__).parent)
    gate = json.dumps({"folder": str(folder), "step": step})
    return {"PYTHONPATH": os.pathsep.join((here, str(ROOT))), "GATE": gate}


def open_gate(folder: Path, *seeds: int) -> None:
    """Let the runs of these seeds go on."""
    for seed in seeds:
        (folder / f"open_{seed}").touch()


def waiting(folder: Path, *seeds: int) -> dict[int, int]:
    """The process ids of the runs that have reached their gate, by seed."""
    found = ((seed, folder / f"reached_{seed}") for seed in seeds)
    return {seed: int(path.read_text()) for seed, path in found if path.exists()}


def forget(folder: Path, *seeds: int) -> None:
    """That runs of these seeds have been here: the next ones are awaited."""
    for seed in seeds:
        (folder / f"reached_{seed}").unlink(missing_ok=True)


def wait_at_gate(folder: Path, seed: int, stop_requested: Callable[[], bool]) -> None:
    """In the training process: say who is here, and wait."""
    reached = folder / f"reached_{seed}"
    beside = reached.with_suffix(".part")
    beside.write_text(str(os.getpid()))
    beside.replace(reached)
    while not (folder / f"open_{seed}").exists() and not stop_requested():
        time.sleep(0.005)


class _Waiting:
    """A progress display whose update does not return while the gate is closed."""

    def __init__(self, progress: Any, folder: Path, seed: int, step: int, stop_requested: Callable[[], bool]) -> None:
        self._progress, self._step = progress, step
        self._wait = partial(wait_at_gate, folder, seed, stop_requested)

    def update(self, step: int, last_return: float | None, steps_per_second: float) -> None:
        self._progress.update(step, last_return, steps_per_second)
        self.at(step)

    def at(self, step: int) -> None:
        if step >= self._step:
            self._wait()

    def note(self, text: str) -> None:
        self._progress.note(text)
