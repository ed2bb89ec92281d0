"""Measure what a checkpoint costs at the end of a long run: Ant, TD3, BPT-SAN, a replay of 1M transitions (0.93 GB).

    python benchmarks/checkpoint.py                  # 1M transitions in a temporary folder, deleted at the end; minutes
    python benchmarks/checkpoint.py --rows 100000    # less

The transitions are noise; the networks, optimizers and everything else of the checkpoint are real. Between two
checkpoints the replay grows by ``--interval`` rows, as it does in a run, so that the flush has something to write.
"""

from __future__ import annotations

import argparse
import shutil
import statistics
import sys
import tempfile
import time
from pathlib import Path

import torch

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from benchmarks.configuration import compose  # noqa: E402
from src.algorithms.learner import Batch  # noqa: E402
from src.config.identity import Run  # noqa: E402
from src.experiment.machine import processor  # noqa: E402
from src.experiment.ownership import acquire  # noqa: E402
from src.experiment.progress import PlainProgress  # noqa: E402
from src.training.checkpoint import checkpoint_paths  # noqa: E402
from src.training.collection import Transitions  # noqa: E402
from src.training.numerics import set_numerics  # noqa: E402
from src.training.replay import sample_minibatches  # noqa: E402
from src.training.session import TrainingSession  # noqa: E402


def noise(rows: int, observation_size: int, action_size: int) -> Transitions:
    """So many transitions of no meaning."""
    observation = torch.randn(rows, observation_size)
    return Transitions(
        observation=observation,
        action=torch.rand(rows, action_size),
        reward=torch.randn(rows),
        next_observation=observation + 0.1,
        terminated=torch.zeros(rows),
        truncated=torch.zeros(rows),
        finished=[],
    )


def measure(folder: Path, rows: int, interval: int, repeats: int) -> None:
    """Fill the replay, save ``repeats`` times, resume, print."""
    overrides = {
        "protocol.total_steps": rows + interval * (repeats + 3),
        "protocol.evaluation_interval": interval * (repeats + 3) + rows,
        "protocol.checkpoint_interval": interval,
        "results_dir": str(folder),
        "study": "benchmark",
        "label": "bptsan",
    }
    keys = [f"{key}={value}" for key, value in overrides.items()]
    config = compose(*keys, env="ant", protocol="paper", logger="none")
    set_numerics(config.threads)
    with acquire(Run(config)) as (run, _):
        session = TrainingSession(config, run, PlainProgress(config.protocol.total_steps))
        while session.step < rows:  # behind the session's back: no environment is stepped
            block = min(10_000, rows - session.step)
            session.replay.extend(noise(block, *session.sizes))
            session.step += block
        one = noise(50, *session.sizes)
        session.environment.reset()
        session.learner.learn(_burst(session))
        session.save()
        seconds = []
        for _ in range(repeats):
            for _ in range(interval // 50):
                session.replay.extend(one)
            session.step += interval
            began = time.perf_counter()
            session.save()
            seconds.append(time.perf_counter() - began)
        newest = checkpoint_paths(run.state)[0].stat().st_size
        replay = (run.state / "replay.bin").stat().st_size
        began = time.process_time()  # on one thread this is what an idle machine's clock would show
        for _ in range(4):
            session.learner.learn(_burst(session))
        update = (time.process_time() - began) / 200
        _write_logs(session)
        began = time.perf_counter()
        again = TrainingSession(config, run, PlainProgress(config.protocol.total_steps))
        again.resume()
        resume = time.perf_counter() - began
        assert again.step == session.step
    save = statistics.median(seconds)
    print(f"processor: {processor()}, {torch.get_num_threads()} thread, torch {torch.__version__}")
    print(f"replay {replay / 1e9:.2f} GB, checkpoint {newest / 1e6:.1f} MB")
    print(f"save: median {save:.2f} s, {min(seconds):.2f} to {max(seconds):.2f} s over {repeats}")
    print(f"resume (build everything and restore): {resume:.2f} s")
    updates = update * interval
    print(f"one update (TD3, bptsan, Ant): {update * 1e3:.1f} ms of processor time, {interval} of them {updates:.0f} s")
    print(f"overhead at a checkpoint every {interval} steps: at most {100 * save / updates:.2f}% of updates")


def _burst(session: TrainingSession) -> Batch:
    sample = sample_minibatches(session.replay, 50, session.config.algo.batch_size)
    return Batch(*sample)


def _write_logs(session: TrainingSession) -> None:
    """The rows that a real run would have written before its checkpoint."""
    session.run.evaluations.append(0, [(0.0, 1)] * session.config.protocol.evaluation_episodes)


def main() -> None:
    """Measure in a folder that is deleted afterwards."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rows", type=int, default=1_000_000)
    parser.add_argument("--interval", type=int, default=10_000)
    parser.add_argument("--repeats", type=int, default=7)
    arguments = parser.parse_args()
    folder = Path(tempfile.mkdtemp(prefix="checkpoint-benchmark-"))
    try:
        if shutil.disk_usage(folder).free < 3 * arguments.rows * 1000:
            sys.exit("not enough free disk for the replay")
        measure(folder, arguments.rows, arguments.interval, arguments.repeats)
    finally:
        shutil.rmtree(folder)


if __name__ == "__main__":
    main()
