"""Evaluation of a policy, on environments and random streams of its own: it moves nothing of the training."""

from __future__ import annotations

from collections.abc import Callable

import gymnasium
import numpy as np
import torch
from torch import Tensor

from src.config.schema import EnvConfig
from src.streams import Streams
from src.training.gym_task import make_gym

#: observations float32 [k, N] and the encoder's generator -> actions float32 [k, M], k = episodes still running.
Act = Callable[[Tensor, torch.Generator], Tensor]

#: The evaluation step of fresh episodes: no training evaluates there.
FRESH = -1

#: A wrapper for the environment of an episode, by its number.
Wrap = Callable[[gymnasium.Env, int], gymnasium.Env]


class Evaluator:
    """Plays episodes of a task side by side, one policy call for all that still run.

    Every episode is seeded by (step, episode) and the encoder by (step), so an evaluation depends on the policy and the
    step alone: not on the evaluations before it, and not on whether the run was stopped in between.
    """

    def __init__(self, task: EnvConfig, episodes: int, streams: Streams, wrap: Wrap | None = None) -> None:
        self._streams = streams
        self._environments = [make_gym(task) for _ in range(episodes)]
        if wrap is not None:
            self._environments = [wrap(each, episode) for episode, each in enumerate(self._environments)]

    def evaluate(self, act: Act, step: int) -> list[tuple[float, int]]:
        """``(return, length)`` of each episode, in the order of their numbers; returns are summed in float64.

        Args:
            act: the policy; called without gradients.
            step: the training step the evaluation belongs to.
        """
        generator = self._streams.torch("evaluation encoder", step)
        running = list(range(len(self._environments)))
        observations = [
            environment.reset(seed=self._streams.integer("evaluation", step, episode))[0]
            for episode, environment in enumerate(self._environments)
        ]
        returns, lengths = [0.0] * len(running), [0] * len(running)
        with torch.no_grad():
            while running:
                actions = act(torch.from_numpy(np.asarray(observations, np.float32)), generator).cpu().numpy()
                still_running, observations = [], []
                for episode, action in zip(running, actions, strict=True):
                    observation, reward, terminated, truncated, _ = self._environments[episode].step(action)
                    returns[episode] += float(reward)
                    lengths[episode] += 1
                    if not (terminated or truncated):
                        still_running.append(episode)
                        observations.append(observation)
                running = still_running
        return list(zip(returns, lengths, strict=True))
