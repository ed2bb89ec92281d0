"""From a configuration to a learner: which algorithm has which parts, and which backend computes it."""

from __future__ import annotations

from collections.abc import Callable
from types import ModuleType

import torch
from torch import Tensor

from src.actors.actor import Actor
from src.actors.build import build_actor
from src.actors.mlp import MLP
from src.algorithms.learner import Learner, UpdateStreams
from src.algorithms.networks import TwinCritic
from src.algorithms.sac import SAC
from src.algorithms.td3 import TD3
from src.algorithms.td3_proxy import TD3Proxy
from src.config.schema import ConfigurationError, ExperimentConfig, TD3Config, TD3ProxyConfig
from src.streams import Streams


def build_learner(
    config: ExperimentConfig, observation_size: int, action_size: int, action_limit: float, streams: Streams
) -> Learner:
    """The learner of a run, initialised from the run's streams.

    Args:
        config: the whole configuration.
        observation_size: N.
        action_size: M.
        action_limit: bound of the actions.
        streams: the run's random streams.

    Raises:
        ConfigurationError: ``backend=fast`` where the engine does not support the actor; see also :func:`build_actor`.
    """
    algo = config.algo
    actor = build_actor(config, observation_size, action_size, streams).to(config.device)
    critic = TwinCritic(observation_size, action_size, algo.critic_hidden_sizes, streams).to(config.device)
    update_streams = UpdateStreams(
        exploration=streams.torch("exploration"),
        update_noise=streams.torch("target noise" if isinstance(algo, TD3Config) else "policy noise"),
        encoder=streams.torch("encoder"),
    )
    engine = engine_for(config, actor)
    if isinstance(algo, TD3ProxyConfig):
        proxy = MLP((observation_size, *algo.proxy_hidden_sizes, action_size), streams, "proxy")
        return TD3Proxy(algo, actor, critic, proxy.to(config.device), action_limit, update_streams)
    if isinstance(algo, TD3Config):
        return (engine.TD3 if engine else TD3)(algo, actor, critic, action_limit, update_streams)
    if algo.log_std_network == "shared":
        log_std = MLP((config.actor.hidden_sizes[-1], action_size), streams, "log_std")  # type: ignore[union-attr]
    else:
        log_std = MLP((observation_size, *algo.log_std_hidden_sizes, action_size), streams, "log_std")
    return (engine.SAC if engine else SAC)(algo, actor, log_std.to(config.device), critic, action_limit, update_streams)


def acting(config: ExperimentConfig, actor: Actor) -> Callable[[Tensor, torch.Generator], Tensor]:
    """The actor's output ``[B, M]`` for ``[B, N]`` without gradient, on the backend of a run of this configuration."""
    engine = engine_for(config, actor)
    found: Callable[[Tensor, torch.Generator], Tensor] = engine.acting(actor) if engine else torch.no_grad()(actor)
    return found


def engine_for(config: ExperimentConfig, actor: Actor) -> ModuleType | None:
    """The engine where ``config.backend`` asks for it or (auto) it supports algorithm and actor; None: plain PyTorch.

    Raises:
        ConfigurationError: fast is asked for and not supported.
    """
    if config.backend == "plain":
        return None
    from src.engine import fast  # the plain path needs nothing of it

    asked, reason = f"algo {config.algo.name}", fast.unsupported_algorithm(config.algo)
    if reason is None:
        asked, reason = f"actor {config.actor.name}", fast.unsupported_reason(actor, config.device)
    if reason is None:
        return fast
    if config.backend == "fast":
        raise ConfigurationError(f"backend: fast does not support {asked} ({reason}); use auto or plain.")
    return None
