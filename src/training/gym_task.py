"""A Gymnasium task from its configuration: time limit, zero padding, and quiet about what is known.

Importing this module imports neither MuJoCo nor torch; a task that is not installed is one clear sentence.
"""

from __future__ import annotations

import logging
import warnings
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces

from src.config.schema import ConfigurationError, EnvConfig

#: Gymnasium's note about v4 tasks: we want v4, the paper's dynamics on the maintained simulator.
_OUT_OF_DATE = r".*The environment .* is out of date.*"
#: MuJoCo's note about HalfCheetah's model file, which belongs to Gymnasium.
_SETTOTALMASS = "compiler attribute 'settotalmass' is deprecated"


def make_gym(config: EnvConfig) -> gymnasium.Env:
    """The task as plain Gymnasium: observations float64 [N], actions in a symmetric box [M], truncated at the limit.

    Raises:
        ConfigurationError: the task (or MuJoCo) is not installed, its arguments are wrong, or its spaces are not
            what an actor of continuous actions needs.
    """
    _quiet_mujoco()
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", message=_OUT_OF_DATE, category=DeprecationWarning)
            environment = gymnasium.make(
                config.id, max_episode_steps=config.max_episode_steps, disable_env_checker=True, **config.kwargs
            )
    except gymnasium.error.DependencyNotInstalled as error:
        raise ConfigurationError(f"env.id: {config.id} needs a package that is not installed: {error}") from None
    except (gymnasium.error.Error, ImportError) as error:
        raise ConfigurationError(f"env.id: Gymnasium has no task {config.id}: {error}") from None
    except TypeError as error:
        raise ConfigurationError(f"env.kwargs: {config.id} does not take {config.kwargs}: {error}") from None
    _check_spaces(config, environment)
    return ZeroPadding(environment, config.zero_padding) if config.zero_padding else environment


def sizes(config: EnvConfig) -> tuple[int, int]:
    """``(N, M)``: the dimensions of observation (padding included) and action.

    Raises:
        ConfigurationError: as :func:`make_gym`.
    """
    environment = make_gym(config)
    try:
        return _size(environment.observation_space), _size(environment.action_space)
    finally:
        environment.close()


def is_mujoco(environment: gymnasium.Env) -> bool:
    """Whether the task's simulator is one whose state can be saved."""
    try:
        from gymnasium.envs.mujoco import MujocoEnv
    except ImportError:
        return False
    return isinstance(environment.unwrapped, MujocoEnv)


def action_limit(environment: gymnasium.Env) -> float:
    """The bound ``b`` of the symmetric box ``[-b, b]^M``."""
    space = environment.action_space
    assert isinstance(space, spaces.Box)
    return float(space.high[0])


class ZeroPadding(gymnasium.ObservationWrapper):
    """Constant zeros appended to the observation: [N] -> [N + padding]."""

    def __init__(self, environment: gymnasium.Env, padding: int) -> None:
        super().__init__(environment)
        self._zeros = np.zeros(padding)
        size = _size(environment.observation_space) + padding
        self.observation_space = spaces.Box(-np.inf, np.inf, (size,), np.float64)

    def observation(self, observation: Any) -> Any:
        """[N] -> [N + padding]."""
        return np.concatenate((observation, self._zeros))


def _size(space: spaces.Space) -> int:
    assert space.shape is not None
    return int(space.shape[0])


def _check_spaces(config: EnvConfig, environment: gymnasium.Env) -> None:
    observations, actions = environment.observation_space, environment.action_space
    if not isinstance(observations, spaces.Box) or len(observations.shape) != 1:
        raise ConfigurationError(f"env.id: {config.id} observes {observations}; the actors take vectors of numbers.")
    if not isinstance(actions, spaces.Box) or len(actions.shape) != 1:
        raise ConfigurationError(f"env.id: {config.id} acts in {actions}; the actors act in a box of real numbers.")
    high = np.asarray(actions.high)
    if not (np.isfinite(high).all() and (high == high[0]).all() and (actions.low == -high).all()):
        raise ConfigurationError(
            f"env.id: {config.id} acts between {actions.low} and {high}; "
            "the actors need one finite limit, the same for all dimensions and both signs."
        )


def _quiet_mujoco() -> None:
    """MuJoCo's warnings go to Python's logging, the one about ``settotalmass`` nowhere; no MUJOCO_LOG.TXT.

    MuJoCo would print and append them to a file in the working directory, which is the user's.
    """
    try:
        import mujoco
    except ImportError:
        return
    mujoco.set_mju_user_warning(_log_warning)
    log = mujoco.MjLogConfig.get()
    log.logto_file = False
    log.set()


def _log_warning(message: str) -> None:
    if not message.startswith(_SETTOTALMASS):
        logging.getLogger("mujoco").warning(message)
