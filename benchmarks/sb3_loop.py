"""Stable-Baselines3's TD3 and SAC, set up as our runs are. Needs the extra ``benchmarks``."""

from __future__ import annotations

from importlib import util
from pathlib import Path
from typing import Any

import numpy as np
import torch

from benchmarks.relay import Turns
from src.config.schema import EnvConfig, ExperimentConfig, SACConfig, TD3Config
from src.training.gym_task import make_gym

MISSING = (
    "Stable-Baselines3 is not installed, so the comparison with it is left out; "
    "install it with: .venv/bin/pip install -c constraints.txt '.[benchmarks]'"
)


def installed() -> bool:
    """Whether the extra is there."""
    return util.find_spec("stable_baselines3") is not None


def stable_baselines3(turns: Turns, config: ExperimentConfig, evaluation_env: EnvConfig, folder: Path) -> None:
    """A runner; times the parts ``evaluation`` (episode after episode, its default) and ``side by side``.

    The same bursts as ours (``train_freq = gradient_steps = update_every``); side by side are the evaluation's episodes
    in one vector environment, as fast as its user can make them; logs to CSV; no normalisation of observations: it
    leaves that to a wrapper.
    """
    from stable_baselines3.common.callbacks import BaseCallback
    from stable_baselines3.common.evaluation import evaluate_policy
    from stable_baselines3.common.logger import configure
    from stable_baselines3.common.monitor import Monitor
    from stable_baselines3.common.vec_env import DummyVecEnv

    p = config.protocol

    def environments(task: EnvConfig, count: int = 1) -> Any:
        return DummyVecEnv([lambda: Monitor(make_gym(task)) for _ in range(count)])

    class Boundary(BaseCallback):
        """Evaluates where due and waits for the next turn, before each burst's collection."""

        def __init__(self) -> None:
            super().__init__()
            self.going_on = True
            self.evaluations = [
                (turns.timed("evaluation", evaluate_policy), environments(evaluation_env)),
                (turns.timed("side by side", evaluate_policy), environments(evaluation_env, p.evaluation_episodes)),
            ]

        def _on_rollout_start(self) -> None:
            if self.num_timesteps % p.evaluation_interval == 0:
                for evaluate, environment in self.evaluations:
                    mean, _ = evaluate(self.model, environment, n_eval_episodes=p.evaluation_episodes)
                    self.logger.record("eval/mean_reward", mean)
            self.going_on = turns.reached(self.num_timesteps)

        def _on_step(self) -> bool:
            return self.going_on

    model = _model(config, environments(config.env))
    model.set_logger(configure(str(folder), ["csv"]))
    model.learn(p.total_steps, callback=Boundary())


def _model(config: ExperimentConfig, environment: Any) -> Any:
    from stable_baselines3 import SAC, TD3
    from stable_baselines3.common.noise import NormalActionNoise

    a, p = config.algo, config.protocol
    hidden = list(a.critic_hidden_sizes)
    common: dict[str, Any] = {
        "learning_rate": a.critic_learning_rate,
        "buffer_size": a.replay_capacity,
        "learning_starts": p.start_steps,
        "batch_size": a.batch_size,
        "tau": 1.0 - a.polyak,
        "gamma": a.discount,
        "train_freq": p.update_every,
        "gradient_steps": p.update_every,
        "policy_kwargs": {"net_arch": hidden, "activation_fn": torch.nn.ReLU},
        "device": "cpu",
        "seed": config.seed,
    }
    if isinstance(a, SACConfig):
        return SAC("MlpPolicy", environment, ent_coef=a.alpha, **common)
    assert isinstance(a, TD3Config)
    size = environment.action_space.shape[0]
    noise = NormalActionNoise(np.zeros(size), np.full(size, a.exploration_noise))
    return TD3(
        "MlpPolicy",
        environment,
        action_noise=noise,
        policy_delay=a.policy_delay,
        target_policy_noise=a.target_noise,
        target_noise_clip=a.target_noise_clip,
        **common,
    )
