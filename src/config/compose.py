"""From Hydra's composed configuration to one validated run, and what it changes about the options that it chose."""

from __future__ import annotations

import dataclasses
import re
from functools import cache
from typing import Any

from hydra import compose, initialize_config_dir
from hydra.core.config_loader import ConfigLoader
from hydra.core.global_hydra import GlobalHydra
from hydra.core.hydra_config import HydraConfig
from hydra.errors import HydraException
from hydra.types import RunMode
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from src.config.identity import Run, flatten, variant_label
from src.config.rules import inert_keys
from src.config.schema import ConfigurationError
from src.config.validation import parse, to_dict, validate
from src.paths import ROOT

#: Groups whose options make a method or a task; a run that changes one of their keys is a variant.
_GROUPS = ("actor", "encoder", "algo", "env")
_METHOD_KEYS = ("normalize_observations", "normalization_clip")
_NOT_COMPARED = frozenset({"encoder.name", "encoder.coding"})  # the path shows the coding


@cache
def composed_from(*overrides: str) -> DictConfig:
    """What Hydra composes from ``conf/`` for a command line, where no command runs: ``composed_from("env=ant")``."""
    with initialize_config_dir(str(ROOT / "conf"), version_base="1.3"):
        return compose("config", list(overrides))


def compose_run(composed: DictConfig) -> Run:
    """Resolve, validate, and name the variant.

    A key that changes nothing in this configuration (``encoder.population_size`` of an actor without spikes) keeps its
    option's own value, so that it makes no variant.

    Raises:
        ConfigurationError: one or more sentences.
    """
    content = _resolved(composed)
    config = validate(content)
    own = _own_values(composed, to_dict(config))
    if inert := [key for key in inert_keys(config) if key in own]:
        settled = OmegaConf.create(content)
        for key in inert:
            OmegaConf.update(settled, key, own[key])
        config = validate(_resolved(settled))
    changed = {key: value for key, value in _compared(to_dict(config)).items() if key not in own or own[key] != value}
    label = config.label if config.label is not None else variant_label(config.actor.name, changed)
    return Run(dataclasses.replace(config, label=label), changed)


def _compared(content: dict[str, Any]) -> dict[str, Any]:
    flat = flatten({key: content[key] for key in (*_GROUPS, *_METHOD_KEYS)})
    return {key: value for key, value in flat.items() if key not in _NOT_COMPARED}


def _own_values(composed: DictConfig, content: dict[str, Any]) -> dict[str, Any]:
    """Dotted keys and values that the chosen options have by themselves, as the schema has them.

    With ``actor=bptsan actor.lateral.radius=4`` the composed radius is 4, and 2 here, as conf/actor/bptsan.yaml says:
    they differ, so that the label is ``bptsan-lateral.radius=4``.

    An interpolation follows this run: ``algo.actor_learning_rate`` is ``${actor.learning_rate}`` of its own actor.
    """
    bare = dict(content)
    for group in _GROUPS:
        whole = _with_bare_option(group, content[group]["name"], *_origin(composed))
        option = OmegaConf.create({**content, group: whole[group]})
        bare[group] = OmegaConf.to_container(option[group], resolve=True)
        bare |= {key: whole[key] for key in _METHOD_KEYS}
    return _compared(to_dict(parse(bare)))


def _origin(composed: DictConfig) -> tuple[str, tuple[str, ...]]:
    """The name of the primary configuration, and overrides that say where more options lie."""
    hydra = composed.get("hydra")
    if hydra is None and HydraConfig.initialized():
        hydra = HydraConfig.get()
    if hydra is None:
        return "config", ()
    searchpath = [each for each in hydra.overrides.hydra if each.lstrip("+").startswith("hydra.searchpath=")]
    return hydra.job.config_name or "config", tuple(searchpath)


@cache
def _with_bare_option(group: str, name: str, config_name: str, searchpath: tuple[str, ...]) -> Any:
    """What Hydra composes, not resolved, where nothing but this option of this group is asked for.

    Raises:
        ConfigurationError: no option has this name.
    """
    loader: ConfigLoader = GlobalHydra.instance().config_loader()
    try:
        whole = loader.load_configuration(config_name, [*searchpath, f"{group}={name}"], RunMode.RUN, from_shell=False)
    except HydraException:
        raise ConfigurationError(
            f"{group}.name: there is no {group}={name}; an option is named as its file, conf/{group}/{name}.yaml."
        ) from None
    return OmegaConf.to_container(whole, resolve=False)


def _resolved(composed: DictConfig) -> dict[str, Any]:
    """Plain containers, without Hydra's own section, some of whose values only exist in a job."""
    own = OmegaConf.masked_copy(composed, [str(key) for key in composed if key != "hydra"])
    try:
        content = OmegaConf.to_container(own, resolve=True, throw_on_missing=True)
    except OmegaConfBaseException as error:
        text = str(error).split("\n")[0]
        missing = re.fullmatch(r"Interpolation key '(\S+)' not found", text)
        raise ConfigurationError(
            f"{missing[1]}: a value is taken from this key, and it is missing." if missing else text
        ) from None
    assert isinstance(content, dict)
    return {str(key): value for key, value in content.items()}
