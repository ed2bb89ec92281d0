"""Cells composed by Hydra from the real conf/, in this process."""

import dataclasses
from functools import cache
from pathlib import Path

from hydra import compose, initialize_config_dir

from src.experiment.compose import cell_of

ROOT = Path(__file__).resolve().parents[2]


@cache
def composed(*overrides):
    with initialize_config_dir(str(ROOT / "conf"), version_base="1.3"):
        return compose("config", list(overrides))


@cache
def cell(*overrides):
    return cell_of(composed(*overrides))


def smoke(results, *overrides):
    named = dict(each.split("=") for each in overrides if each.startswith("on_conflict="))
    config = cell("protocol=smoke", *(each for each in overrides if not each.startswith("on_conflict=")))
    return dataclasses.replace(config, results_dir=str(results), **named)
