"""What can be known before a run starts: its task can be built here, its logger is installed, its GPU is there.

A mistake costs one sentence instead of a queue of failed jobs. Never imports torch in this process.
"""

from __future__ import annotations

import importlib.util
import json
import subprocess
import sys
import tempfile
from collections.abc import Iterable
from functools import cache

from src.config import ConfigurationError, EnvConfig, ExperimentConfig
from src.paths import repository_path

_LOGGERS = {
    "wandb": "logger=wandb: wandb is not installed; run: pip install '.[wandb]'",
    "tensorboard": "logger=tensorboard: tensorboard is not installed; install it, or take logger=none",
}


def check_installed(configs: Iterable[ExperimentConfig]) -> None:
    """Build each distinct task once, and look for the loggers' packages.

    Raises:
        ConfigurationError: one sentence per mistake.
    """
    tasks: dict[str, EnvConfig] = {}
    loggers = set()
    for config in configs:
        tasks.setdefault(json.dumps([config.env.id, config.env.kwargs], sort_keys=True), config.env)
        loggers.add(config.logger.name)
    mistakes = [_LOGGERS[name] for name in sorted(loggers & _LOGGERS.keys()) if importlib.util.find_spec(name) is None]
    for task in tasks.values():
        try:
            build_task(task)
        except ConfigurationError as error:
            mistakes.append(str(error))
    if mistakes:
        raise ConfigurationError("\n".join(mistakes))


def build_task(task: EnvConfig) -> None:
    """Build a task and take one step.

    Raises:
        ConfigurationError: that can't be done on this machine, or the task is none that a run can be saved on.
    """
    from src.training.gym_task import is_mujoco, make_gym  # Gymnasium takes a while to import

    environment = make_gym(task)
    try:
        if not is_mujoco(environment):
            raise ConfigurationError(
                f"env.id: {task.id} is no MuJoCo task of Gymnasium, so a run on it could not be saved and resumed."
            )
        environment.reset(seed=0)
        environment.step(environment.action_space.sample() * 0)
    except ConfigurationError:
        raise
    except Exception as error:
        raise ConfigurationError(
            f"env: {task.id} with the arguments {task.kwargs} fails at its first step: {type(error).__name__}: {error}"
        ) from None
    finally:
        environment.close()


def check_devices(configs: Iterable[ExperimentConfig]) -> None:
    """Ask PyTorch, in a process of its own, for the GPUs that runs of this machine want.

    Raises:
        ConfigurationError: one of them isn't there.
    """
    for device in sorted({config.device for config in configs if config.device != "cpu"}):
        wanted = int(device.partition(":")[2] or 0)
        if wanted >= gpu_count():
            found = f"{gpu_count()} CUDA GPU{'s' * (gpu_count() != 1)}" if gpu_count() else "no CUDA GPU"
            raise ConfigurationError(f"device: {device} is asked for and PyTorch finds {found}; use cpu.")


@cache
def gpu_count() -> int:
    """How many CUDA devices PyTorch finds on this machine."""
    command = [sys.executable, "-c", "import torch; print(torch.cuda.device_count() * torch.cuda.is_available())"]
    done = subprocess.run(command, capture_output=True, text=True)
    return int(done.stdout) if done.returncode == 0 else 0


def check_writable(config: ExperimentConfig) -> None:
    """Try to write where the results go.

    Raises:
        ConfigurationError: that can't be done.
    """
    folder = repository_path(config.results_dir)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise ConfigurationError(
            f"results_dir: {config.results_dir} can't be written ({error.strerror}); choose another folder."
        ) from None
