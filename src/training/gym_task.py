"""A Gymnasium task from its configuration: time limit, zero padding, and quiet about what is known.

Importing this module imports neither MuJoCo nor torch; a task that is not installed is one clear sentence.
"""

from __future__ import annotations

import logging
import warnings
from contextlib import closing

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.wrappers import TransformObservation

from src.config.schema import ConfigurationError, EnvConfig

#: Gymnasium's note about v4 tasks: we want v4, the paper's dynamics on the maintained simulator.
_OUT_OF_DATE = r".*The environment .* is out of date.*"
#: MuJoCo's note about HalfCheetah's model file, which belongs to Gymnasium.
_SETTOTALMASS = "compiler attribute 'settotalmass' is deprecated"


def make_gym(config: EnvConfig) -> gymnasium.Env:
    """The task as plain Gymnasium: observations float64 [N], actions in a symmetric box [M], truncated at the limit.

    Raises:
        ConfigurationError: the task (or MuJoCo) is not installed, its arguments are wrong, its spaces are not what an
            actor of continuous actions needs, or its simulator is not MuJoCo (its state could not be saved).
    """
    _quiet_mujoco()
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", message=_OUT_OF_DATE, category=DeprecationWarning)
            environment = gymnasium.make(
                config.id, max_episode_steps=config.max_episode_steps, disable_env_checker=True, **config.kwargs
            )
        from gymnasium.envs.mujoco import MujocoEnv
    except gymnasium.error.DependencyNotInstalled as error:
        raise ConfigurationError(f"env.id: {config.id} needs a package that is not installed: {error}") from None
    except (gymnasium.error.Error, ImportError) as error:
        raise ConfigurationError(f"env.id: Gymnasium has no task {config.id}: {error}") from None
    except TypeError as error:
        raise ConfigurationError(f"env.kwargs: {config.id} does not take {config.kwargs}: {error}") from None
    _check_task(config, environment, MujocoEnv)
    return _zero_padded(environment, config.zero_padding) if config.zero_padding else environment


def sizes(config: EnvConfig) -> tuple[int, int]:
    """``(N, M)``: the dimensions of observation (padding included) and action.

    Raises:
        ConfigurationError: as :func:`make_gym`.
    """
    with closing(make_gym(config)) as environment:
        return box(environment.observation_space).shape[0], box(environment.action_space).shape[0]


def box(space: spaces.Space) -> spaces.Box:
    """The observation space ``[N]`` or the action space ``[-b, b]^M`` of a task of :func:`make_gym`."""
    assert isinstance(space, spaces.Box)
    return space


def _zero_padded(environment: gymnasium.Env, padding: int) -> gymnasium.Env:
    """Constant zeros appended to the observation: [N] -> [N + padding]."""
    zeros = np.zeros(padding)
    size = box(environment.observation_space).shape[0] + padding
    space = spaces.Box(-np.inf, np.inf, (size,), np.float64)
    return TransformObservation(environment, lambda observation: np.concatenate((observation, zeros)), space)


def _check_task(config: EnvConfig, environment: gymnasium.Env, mujoco_task: type) -> None:
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
    if not isinstance(environment.unwrapped, mujoco_task):
        raise ConfigurationError(
            f"env.id: {config.id} is no MuJoCo task of Gymnasium, so a run on it could not be saved and resumed."
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
