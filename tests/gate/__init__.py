"""A gate in a training run: there it waits until the test opens it, or until it is asked to stop.

So that no test guesses how fast a machine trains: what is to happen "in mid-run" happens while the run waits. Each seed
has a gate of its own in a folder of the test's.
"""

from __future__ import annotations

import json
import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]


def close_gate(folder: str, step: int) -> None:
    """In the training process: let every run wait at environment step ``step`` or, if it begins later, at its first."""
    from src.training import session

    train = session.train

    def gated(config: Any, run: Any, progress: Any, stop_requested: Callable[[], bool]) -> Any:
        return train(config, run, _Waiting(progress, Path(folder), config.seed, step, stop_requested), stop_requested)

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


class _Waiting:
    """A progress display whose update does not return while the gate is closed."""

    def __init__(self, progress: Any, folder: Path, seed: int, step: int, stop_requested: Callable[[], bool]) -> None:
        self._progress = progress
        self._open, self._reached = folder / f"open_{seed}", folder / f"reached_{seed}"
        self._step = step
        self._stop_requested = stop_requested

    def update(self, step: int, last_return: float | None, steps_per_second: float) -> None:
        self._progress.update(step, last_return, steps_per_second)
        if step < self._step:
            return
        if not self._reached.exists():
            beside = self._reached.with_suffix(".part")
            beside.write_text(str(os.getpid()))
            beside.rename(self._reached)
        while not self._open.exists() and not self._stop_requested():
            time.sleep(0.005)

    def note(self, text: str) -> None:
        self._progress.note(text)
