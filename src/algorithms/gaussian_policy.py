"""SAC's policy: a tanh-Gaussian whose mean is an actor's output (METHOD sections 1 and 3).

The log standard deviation is a network's of its own, or a second head on the trunk of a multilayer perceptron.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import torch
from torch import Tensor

from src.actors.actor import Actor
from src.actors.health import NOTHING_SPIKES, ActorHealth
from src.actors.mlp_actor import MLPActor
from src.algorithms import sac
from src.algorithms.policy import LogStdNetwork
from src.ensemble_mlp import EnsembleMLP
from src.places import GradientOf


class Sample(NamedTuple):
    """Actions drawn from the policy."""

    action: Tensor  # [B, M]
    log_probability: Tensor  # [B]


#: From the gradients to actions ``[B, M]`` and log-probabilities ``[B]`` to those of the parameters, filled.
PullPolicy = Callable[[Tensor, Tensor, GradientOf], None]
#: The same from the gradients to mean and log-std, ``[B, M]``.
PullHeads = Callable[[Tensor, Tensor, GradientOf], None]


Pair = tuple[Tensor, Tensor]


def _halves(x: Tensor, first: int) -> Pair:
    return x[:first], x[first:]


class GaussianPolicy:
    """Samples ``limit * tanh(mean(s) + std(s) * noise)`` and their log-probability.

    Args:
        actor: network ``[B, N] -> mean [B, M]``.
        log_std: network ``-> log-std [B, M]``, of the observation or of the trunk's features.
        shared_trunk: the latter; the actor is a multilayer perceptron.
        bounds: of the log-std, and of the actions.
    """

    def __init__(self, actor: Actor, log_std: LogStdNetwork, shared_trunk: bool, bounds: sac.Bounds) -> None:
        self.actor, self.log_std, self.shared_trunk, self.bounds = actor, log_std, shared_trunk, bounds

    @torch.no_grad()
    def sample(self, observation: Tensor, noise: Tensor, generator: torch.Generator | None) -> Sample:
        """Without gradient, for ``[B, N]`` and standard normal noise ``[B, M]``; the generator is the encoder's."""
        if self.shared_trunk:
            trunk, heads = self._trunk()
            features = trunk(observation).squeeze(0)
            mean, log_std = (head(features).squeeze(0) for head in heads)
        else:
            mean, log_std = self.actor(observation, generator), self.log_std(observation)
        action, log_probability, _ = sac.tanh_gaussian_vjp(mean, log_std, noise, self.bounds)
        return Sample(action, log_probability)

    def vjp_after(
        self,
        before: Tensor,
        observation: Tensor,
        noise: tuple[Tensor, Tensor],
        generator: torch.Generator | None,
        with_health: bool = False,
    ) -> tuple[Sample, Sample, ActorHealth | None, PullPolicy]:
        """A sample for the observations ``before``, without gradient, and one for ``observation``, both ``[B, N]``.

        Args:
            before: what is sampled first.
            observation: what the gradient is of.
            noise: standard normal, ``[B, M]``, for each.
            generator: the encoder's.
            with_health: whether to measure the spiking health of the second.

        Returns:
            The two samples, the health or None, and the vector-Jacobian product of the second.
        """
        means, log_stds, health, pull_parameters = (self._heads if self.shared_trunk else self._networks)(
            before, observation, generator, with_health
        )
        action, log_probability, _ = sac.tanh_gaussian_vjp(means[0], log_stds[0], noise[0], self.bounds)
        first = Sample(action, log_probability)
        action, log_probability, pull_sample = sac.tanh_gaussian_vjp(means[1], log_stds[1], noise[1], self.bounds)

        def pull(to_action: Tensor, to_log_probability: Tensor, gradient_of: GradientOf) -> None:
            pull_parameters(*pull_sample(to_action, to_log_probability), gradient_of)

        return first, Sample(action, log_probability), health, pull

    def _networks(
        self, before: Tensor, observation: Tensor, generator: torch.Generator | None, with_health: bool
    ) -> tuple[Pair, Pair, ActorHealth | None, PullHeads]:
        """Means and log-stds by a network each; the last takes the gradients to those of the observation."""
        mean_before, mean, health, pull_mean = self.actor.vjp_after(before, observation, generator, with_health)
        log_std, pull_log_std = self.log_std.network.vjp(torch.cat([before, observation]), len(observation))

        def pull(to_mean: Tensor, to_log_std: Tensor, gradient_of: GradientOf) -> None:
            pull_mean(to_mean, gradient_of)
            pull_log_std(to_log_std.unsqueeze(0), gradient_of, False)

        return (mean_before, mean), _halves(log_std[0], len(before)), health, pull

    def _heads(
        self, before: Tensor, observation: Tensor, generator: torch.Generator | None, with_health: bool
    ) -> tuple[Pair, Pair, ActorHealth | None, PullHeads]:
        """Means and log-stds by a head each of the actor's trunk."""
        trunk, heads = self._trunk()
        last = len(observation)
        features, pull_features = trunk.vjp(torch.cat([before, observation]), last)
        (mean, pull_mean), (log_std, pull_log_std) = (head.vjp(features[0], last) for head in heads)

        def pull(to_mean: Tensor, to_log_std: Tensor, gradient_of: GradientOf) -> None:
            to_features = [
                pull_head(to_head.unsqueeze(0), gradient_of, True)
                for pull_head, to_head in zip((pull_mean, pull_log_std), (to_mean, to_log_std))
            ]
            both = torch.add(*to_features).unsqueeze(0)  # type: ignore[arg-type]
            pull_features(both, gradient_of, False)

        health = NOTHING_SPIKES if with_health else None
        return _halves(mean[0], len(before)), _halves(log_std[0], len(before)), health, pull

    def _trunk(self) -> tuple[EnsembleMLP, tuple[EnsembleMLP, EnsembleMLP]]:
        assert isinstance(self.actor, MLPActor)  # only it has a trunk (src/config_rules.py)
        return self.actor.hidden, (self.actor.output, self.log_std.network)
