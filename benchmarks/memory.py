"""Memory of a run on Ant whose replay holds 1M transitions, and how often sampling copies them."""

from __future__ import annotations

import shutil
import sys
import tempfile
from pathlib import Path
from typing import Any

import torch
from torch.utils._python_dispatch import TorchDispatchMode
from torch.utils._pytree import tree_leaves

from benchmarks.checkpoint import noise
from benchmarks.configuration import compose
from benchmarks.our_loop import Silent
from benchmarks.process_memory import watch
from benchmarks.topic import Row, Topic
from src.config.identity import Run
from src.config.schema import ExperimentConfig
from src.experiment.ownership import acquire
from src.experiment.run_directory import REPLAY_FILE
from src.paths import ROOT
from src.training.replay import Replay, TransitionLog, sample_minibatches
from src.training.session import TrainingSession

N, M = 111, 8
ROW_BYTES = 4 * (2 * N + M + 2)
_BLOCK = 10_000


def topic(quick: bool = False) -> Topic:
    """The same command with an empty and with a full replay."""
    rows, steps = (20_000, 100) if quick else (1_000_000, 500)
    result = Topic(
        title="memory of a run",
        method=(
            f"python -m src.run on Ant, BPT-SAN, TD3, watched in /proc while it trains {steps:,} steps and takes a "
            f"checkpoint: from scratch, and resumed at step {rows:,} with that many (synthetic) transitions in its "
            "replay. Peaks in MB; file-backed pages are the libraries' and the replay's: the kernel takes them back at "
            "need."
        ),
        columns={
            "replay": "transitions",
            "replay_mb": "replay file",
            "resident": "resident",
            "anonymous": "anonymous",
            "file": "file-backed",
            "replay_resident": "of these the replay",
            "replay_anonymous": "private copies of it",
        },
    )
    folder = Path(tempfile.mkdtemp(prefix="benchmark-"))
    try:
        if shutil.disk_usage(folder).free < 2 * rows * ROW_BYTES:
            result.notes.append("not enough free disk for the replay: not measured")
            return result
        result.rows = [_run(folder / "empty", 0, steps), _run(folder / "full", rows, steps)]
        copies = bytes_allocated_per_byte_sampled(folder / "sampled.bin")
        result.notes.append(f"sampling a burst allocates {copies:.2f} bytes per byte of minibatches (1 is one copy)")
    finally:
        shutil.rmtree(folder)
    return result


def _run(folder: Path, rows: int, steps: int) -> Row:
    folder.mkdir()
    overrides = [
        "protocol=paper",
        "env=ant",
        "actor=bptsan",
        "logger=none",
        f"protocol.total_steps={rows + steps}",
        "protocol.start_steps=100",
        "protocol.update_after=100",
        f"protocol.evaluation_interval={rows + steps}",
        f"protocol.checkpoint_interval={rows + steps}",
        "protocol.evaluation_episodes=1",
        "study=benchmark",
        f"results_dir={folder}",
    ]
    if rows:
        _write_state(compose(*overrides), rows)
    peak = watch([sys.executable, "-m", "src.run", *overrides], ROOT, folder / "output.txt", REPLAY_FILE)
    return {"replay": f"{rows:,}", "replay_mb": rows * ROW_BYTES / 1e6, **peak._asdict()}


def _write_state(config: ExperimentConfig, rows: int) -> None:
    """A run that stands at step ``rows``: replay by its own ``extend``, checkpoint by the session's ``save``."""
    with acquire(Run(config)) as (run, _):
        session = TrainingSession(config, run, Silent())
        assert session.sizes == (N, M)
        block = noise(_BLOCK, N, M)
        while session.step < rows:
            session.replay.extend(block)
            session.step += _BLOCK
        session.normalizer.update(block.observation)
        session.environment.reset()
        session.save()
        run.evaluations.append(0, [(0.0, 1)] * config.protocol.evaluation_episodes)


def bytes_allocated_per_byte_sampled(path: Path, count: int = 50, batch: int = 100) -> float:
    """All that PyTorch allocates while it draws a burst, over the bytes that the burst holds (indices not counted)."""
    replay = Replay(TransitionLog(path, _BLOCK, N, M), _BLOCK, torch.Generator().manual_seed(0))
    replay.extend(noise(_BLOCK, N, M))
    with _Allocations() as allocations:
        burst = sample_minibatches(replay, count, batch)
    allocated = sum(storage.nbytes() for storage in allocations.made.values()) - count * batch * 8
    return allocated / sum(x.numel() * x.element_size() for x in burst)


class _Allocations(TorchDispatchMode):
    """Every storage that PyTorch's operations make, by address; holding them keeps an address from coming again."""

    def __init__(self) -> None:
        super().__init__()
        self.made: dict[int, torch.UntypedStorage] = {}
        self._given: set[int] = set()

    def __torch_dispatch__(self, func: Any, types: Any, args: Any = (), kwargs: Any = None) -> Any:
        result = func(*args, **(kwargs or {}))
        self._given |= {s.data_ptr() for s in _storages((args, kwargs))} - self.made.keys()
        self.made |= {s.data_ptr(): s for s in _storages(result) if s.data_ptr() not in self._given}
        return result


def _storages(tree: Any) -> list[torch.UntypedStorage]:
    return [leaf.untyped_storage() for leaf in tree_leaves(tree) if isinstance(leaf, torch.Tensor)]
