"""The exact state of a MuJoCo task in mid-episode, as plain tensors, numbers and strings.

MuJoCo's integration state (positions, velocities, actuators, time, controls, warm start) continues the *physics*
exactly, but not the *task*: rewards and observations read derived quantities which lag the state by one substep until
the next ``mj_forward`` (Ant's reward reads ``xpos``, its observation the contact forces ``cfrc_ext``). So these are
saved as well and copied back, and nothing is recomputed: an ``mj_forward`` would move them.
"""

from __future__ import annotations

import json
from typing import Any

import gymnasium
import mujoco
import numpy as np
import torch
from gymnasium.envs.mujoco import MujocoEnv

from src.training.checkpoint import CorruptState

#: Derived quantities of ``MjData`` that Gymnasium's tasks read: body, inertial-frame, geometry and site positions,
#: centres of mass, inertias, velocities, actuator and contact forces.
_DERIVED = ("xpos", "xipos", "geom_xpos", "site_xpos", "subtree_com", "cinert", "cvel", "qfrc_actuator", "cfrc_ext")
_SIGNATURE = int(mujoco.mjtState.mjSTATE_INTEGRATION)


def capture(environment: gymnasium.Env) -> dict[str, Any]:
    """Everything that decides how the episode, and the episodes after it, go on.

    Returns:
        ``physics`` float64 [S] (MuJoCo's integration state), one float64 tensor for each derived quantity,
        ``elapsed_steps`` (the time limit's counter) and ``random`` (JSON: the state of the task's own generator).
    """
    task = _task(environment)
    physics = np.empty(mujoco.mj_stateSize(task.model, _SIGNATURE), np.float64)
    mujoco.mj_getState(task.model, task.data, physics, _SIGNATURE)
    state: dict[str, Any] = {"physics": torch.from_numpy(physics)}
    for name in _DERIVED:
        state[name] = torch.from_numpy(np.array(getattr(task.data, name), np.float64))
    state["elapsed_steps"] = int(environment.get_wrapper_attr("_elapsed_steps") or 0)
    state["random"] = json.dumps(task.np_random.bit_generator.state)
    return state


def restore(environment: gymnasium.Env, state: dict[str, Any]) -> None:
    """Put the task into a captured state. The last observation is the caller's to hand back.

    Raises:
        CorruptState: the state is incomplete or belongs to another task or another version of MuJoCo.
    """
    task = _task(environment)
    try:
        _check_sizes(task, state)
        environment.reset()  # opens the wrappers; everything it sets is overwritten below
        mujoco.mj_setState(task.model, task.data, state["physics"].numpy(), _SIGNATURE)
        for name in _DERIVED:
            getattr(task.data, name)[:] = state[name].numpy()
        environment.set_wrapper_attr("_elapsed_steps", int(state["elapsed_steps"]))
        task.np_random.bit_generator.state = json.loads(state["random"])
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise CorruptState(f"the saved simulator state does not fit the task: {error!r}") from error


def _check_sizes(task: MujocoEnv, state: dict[str, Any]) -> None:
    expected = {"physics": (mujoco.mj_stateSize(task.model, _SIGNATURE),)}
    expected |= {name: getattr(task.data, name).shape for name in _DERIVED}
    for name, shape in expected.items():
        if tuple(state[name].shape) != shape or state[name].dtype != torch.float64:
            raise ValueError(f"{name} has shape {tuple(state[name].shape)} and the task {shape}")


def _task(environment: gymnasium.Env) -> MujocoEnv:
    task = environment.unwrapped
    assert isinstance(task, MujocoEnv)
    return task
