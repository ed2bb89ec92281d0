"""From Hydra's composed configuration to one validated cell."""

from __future__ import annotations

import dataclasses
import importlib.util
from functools import cache

from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from src.config import ConfigurationError, ExperimentConfig, validate
from src.experiment.labels import label_of


def cell_of(composed: DictConfig) -> ExperimentConfig:
    """Resolve, validate, and name the variant; the environment must be installed.

    Raises:
        ConfigurationError: one or more sentences.
    """
    # Hydra's own section has values that only exist in a job.
    own = OmegaConf.masked_copy(composed, [str(key) for key in composed if key != "hydra"])
    try:
        content = OmegaConf.to_container(own, resolve=True, throw_on_missing=True)
    except OmegaConfBaseException as error:
        raise ConfigurationError(str(error).split("\n")[0]) from None
    assert isinstance(content, dict)
    config = validate({str(key): value for key, value in content.items()})
    if mistake := _environment_mistake(config.env.id):
        raise ConfigurationError(mistake)
    return dataclasses.replace(config, label=label_of(config))


@cache
def _environment_mistake(name: str) -> str | None:
    """Why ``gymnasium.make(name)`` would fail, as far as the registry knows."""
    import gymnasium

    try:
        spec = gymnasium.spec(name)
    except (gymnasium.error.Error, ModuleNotFoundError) as error:
        return f"env.id: {name} is not installed: {error}"
    entry = spec.entry_point
    if callable(entry) and "raise" in getattr(entry, "__name__", ""):
        return f"env.id: {name} needs the retired mujoco-py; use its -v4 or -v5."
    module = str(entry).partition(":")[0]
    if module.startswith("gymnasium.envs.mujoco") and importlib.util.find_spec("mujoco") is None:
        return f"env.id: {name} needs MuJoCo; install it with `pip install mujoco`."
    try:
        if not callable(entry) and importlib.util.find_spec(module) is None:
            return f"env.id: {name} needs the module {module}, which is not installed."
    except ModuleNotFoundError as error:
        return f"env.id: {name} needs the module {error.name}, which is not installed."
    return None
