"""Runs composed by Hydra from the real conf/, in this process, as the command line composes them."""

import dataclasses
from functools import cache

from hydra import compose, initialize_config_dir

from src.config.compose import compose_run
from src.config.compose import composed_from as composed
from tests.helpers import CONF, ROOT

__all__ = ["ROOT", "changed", "composed", "run_of", "smoke"]


@cache
def run_of(*overrides):
    with initialize_config_dir(str(CONF), version_base="1.3"):
        return compose_run(compose("config", list(overrides), return_hydra_config=True))


def smoke(results, *overrides):
    """A run of 2,000 steps in ``results``."""
    named = dict(each.split("=") for each in overrides if each.startswith("on_conflict="))
    run = run_of("protocol=smoke", *(each for each in overrides if not each.startswith("on_conflict=")))
    return changed(run, results_dir=str(results), **named)


def changed(run, **keys):
    """The same run with other keys of its configuration's top level."""
    return dataclasses.replace(run, config=dataclasses.replace(run.config, **keys))
