"""What the fork server of these tests loads: libraries, and nothing that a configuration could change."""

import gymnasium.envs.mujoco  # noqa: F401
import hydra  # noqa: F401
import torch

import src.training.session  # noqa: F401

torch.set_num_threads(1)  # a pool of threads would not survive the fork
