"""Measure the uniformly random policy: the zero of every normalised score.

    python -m benchmarks.random_policy            # 100 episodes a task, about a minute; prints YAML

Actions are uniform in the action box, episodes end at termination or after ``max_episode_steps``; the environment
and the actions are seeded with 0, so the same Gymnasium and MuJoCo give the same numbers. The values stand, with their
n and standard deviation, in ``analysis/reference_scores.yaml``. Tasks and their options are those of ``conf/env``.
"""

from __future__ import annotations

import argparse
import sys
import warnings
from pathlib import Path

import gymnasium
import numpy as np
import yaml

from benchmarks.configuration import compose
from src.config.schema import EnvConfig

CONF = Path(__file__).resolve().parents[1] / "conf" / "env"


def returns_of(task: EnvConfig, episodes: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Returns and lengths of ``episodes`` random episodes, each array ``[episodes]``."""
    env = gymnasium.make(task.id, max_episode_steps=task.max_episode_steps, **task.kwargs)
    env.action_space.seed(seed)
    returns, lengths = np.zeros(episodes), np.zeros(episodes, dtype=int)
    env.reset(seed=seed)
    for episode in range(episodes):
        if episode:
            env.reset()
        over = False
        while not over:
            _, reward, terminated, truncated, _ = env.step(env.action_space.sample())
            returns[episode] += float(reward)
            lengths[episode] += 1
            over = terminated or truncated
    env.close()
    return returns, lengths


def main() -> int:
    """Measure every task of ``conf/env`` and print the ``random_policy`` block of the reference file."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--episodes", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    warnings.filterwarnings("ignore", message=".*out of date.*")
    measured = {}
    for path in sorted(CONF.glob("*.yaml")):
        task = compose(env=path.stem).env
        returns, lengths = returns_of(task, options.episodes, options.seed)
        measured[task.name] = {
            "mean": round(float(returns.mean()), 3),
            "std": round(float(returns.std(ddof=1)), 3),
            "n": options.episodes,
            "mean_length": round(float(lengths.mean()), 1),
        }
    yaml.safe_dump({"random_policy": measured}, sys.stdout, sort_keys=False)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
