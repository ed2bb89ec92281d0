"""Evaluation of a policy, on environments and random streams of its own: it moves nothing of the training."""

from __future__ import annotations

from collections.abc import Callable

import gymnasium
import numpy as np
import torch
from torch import Tensor

from src.config.schema import ExperimentConfig
from src.streams import Streams
from src.training.gym_task import make_gym

#: observations float32 [k, N] and the encoder's generator -> actions float32 [k, M], k = episodes still running.
Act = Callable[[Tensor, torch.Generator], Tensor]

#: A wrapper for the environment of an episode, by its number.
Wrap = Callable[[gymnasium.Env, int], gymnasium.Env]


class Evaluator:
    """Plays ``protocol.evaluation_episodes`` episodes side by side, one policy call for all that still run.

    Every episode is seeded by (step, episode) and the encoder by (step), so an evaluation depends on the policy and the
    step alone: not on the evaluations before it, and not on whether the run was stopped in between.
    """

    def __init__(self, config: ExperimentConfig, streams: Streams, wrap: Wrap | None = None) -> None:
        self._config = config
        self._wrap = wrap
        self._streams = streams
        self._environments: list[gymnasium.Env] = []

    def evaluate(self, act: Act, step: int) -> list[tuple[float, int]]:
        """``(return, length)`` of each episode, in the order of their numbers; returns are summed in float64.

        Args:
            act: the policy; called without gradients.
            step: the training step the evaluation belongs to.
        """
        generator = self._streams.torch("evaluation encoder", step)
        environments = self._open()
        running = list(range(len(environments)))
        observations = [
            environment.reset(seed=self._streams.integer("evaluation", step, episode))[0]
            for episode, environment in enumerate(environments)
        ]
        returns, lengths = [0.0] * len(running), [0] * len(running)
        with torch.no_grad():
            while running:
                actions = act(torch.from_numpy(np.asarray(observations, np.float32)), generator).cpu().numpy()
                still_running, observations = [], []
                for episode, action in zip(running, actions, strict=True):
                    observation, reward, terminated, truncated, _ = environments[episode].step(action)
                    returns[episode] += float(reward)
                    lengths[episode] += 1
                    if not (terminated or truncated):
                        still_running.append(episode)
                        observations.append(observation)
                running = still_running
        return list(zip(returns, lengths, strict=True))

    def close(self) -> None:
        """Release the environments."""
        for environment in self._environments:
            environment.close()
        self._environments = []

    def _open(self) -> list[gymnasium.Env]:
        if not self._environments:
            episodes = self._config.protocol.evaluation_episodes
            self._environments = [make_gym(self._config.env) for _ in range(episodes)]
            if self._wrap is not None:
                self._environments = [self._wrap(each, episode) for episode, each in enumerate(self._environments)]
        return self._environments
