"""From a configuration to a learner: the one place that knows which algorithm has which parts."""

from __future__ import annotations

from src.actors.build import build_actor
from src.algorithms.critic import TwinCritic
from src.algorithms.learner import Learner, UpdateStreams
from src.algorithms.policy import LogStdNetwork
from src.algorithms.sac_learner import SACLearner
from src.algorithms.td3_learner import TD3Learner
from src.config import ExperimentConfig, TD3Config
from src.streams import Streams


def build_learner(
    config: ExperimentConfig,
    observation_size: int,
    action_size: int,
    action_limit: float,
    streams: Streams,
    *,
    reference: bool = False,
) -> Learner:
    """The learner of a run, initialised from the run's streams.

    Args:
        config: the whole configuration.
        observation_size: N.
        action_size: M.
        action_limit: bound of the actions.
        streams: the run's random streams.
        reference: spiking actors as plain step-by-step eager PyTorch (for tests and benchmarks).
    """
    algo = config.algo
    actor = build_actor(config, observation_size, action_size, streams, reference=reference).to(config.device)
    critic = TwinCritic(observation_size, action_size, algo.critic_hidden_sizes, streams).to(config.device)
    update_streams = UpdateStreams(
        exploration=streams.torch("exploration"),
        update_noise=streams.torch("target noise" if isinstance(algo, TD3Config) else "policy noise"),
        encoder=streams.torch("encoder"),
    )
    if isinstance(algo, TD3Config):
        return TD3Learner(algo, actor, critic, action_limit, update_streams)
    if algo.log_std_network == "shared":
        log_std = LogStdNetwork(config.actor.hidden_sizes[-1], action_size, streams, ())  # type: ignore[union-attr]
    else:
        log_std = LogStdNetwork(observation_size, action_size, streams, algo.log_std_hidden_sizes)
    return SACLearner(algo, actor, log_std.to(config.device), critic, action_limit, update_streams)
