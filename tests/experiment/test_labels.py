"""If these fail, a variant passes for the paper's own actor in paths and reports."""

import re

import pytest

from src.config import ConfigurationError
from src.experiment.identity import LONGEST_LABEL
from tests.experiment.runs import run_of


@pytest.mark.parametrize(
    ("overrides", "label"),
    [
        ((), "bptsan"),
        (("actor=aan",), "aan"),
        (("algo=sac", "actor=aan"), "aan"),
        (("actor.lateral.radius=4",), "bptsan-lateral.radius=4"),
        (("actor.lateral.radius=2",), "bptsan"),
        (("actor.lateral.radius=4", "actor.dendritic.branches=3"), "bptsan-dendritic.branches=3,lateral.radius=4"),
        (("algo.discount=0.9",), "bptsan-algo.discount=0.9"),
        (("encoder.population_size=5",), "bptsan-encoder.population_size=5"),
        (("encoder=deterministic",), "bptsan"),
        (("actor.hidden_sizes=[64,64]",), "bptsan-hidden_sizes=[64,64]"),
        (("actor.mask_seed=7",), "bptsan-mask_seed=7"),
        (("encoder.learnable=false",), "bptsan-encoder.learnable=false"),
        (("actor.learning_rate=1e-3",), "bptsan-learning_rate=0.001"),
        (("algo.actor_learning_rate=1e-3",), "bptsan-algo.actor_learning_rate=0.001"),
        (("env=ant", "protocol=short", "threads=2"), "bptsan"),
        (("label=mine", "actor.lateral.radius=4"), "mine"),
    ],
)
def test_label(overrides, label):
    assert run_of(*overrides).label == label
    assert run_of(*overrides).path.parts[-3] == label


def test_changed_keys_are_recorded_even_under_an_explicit_label():
    assert run_of("label=mine", "actor.lateral.radius=4").changed_keys == {"actor.lateral.radius": 4}


def test_a_long_label_is_cut_but_stays_unique_and_safe():
    sizes = [f"actor.hidden_sizes=[{','.join(['64'] * 60)},{last}]" for last in (64, 65)]
    labels = {run_of(each).label for each in sizes}
    assert len(labels) == 2
    for label in labels:
        assert len(label) <= LONGEST_LABEL + 9
        assert re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9_.,=+\[\]-]*", label)


def test_an_option_that_is_not_named_as_its_file_is_refused():
    with pytest.raises(
        ConfigurationError, match=r"there is no actor=mine; an option is named as its file, conf/actor/mine\.yaml"
    ):
        run_of("actor.name=mine")


def test_a_name_borrowed_from_the_papers_actor_shows_what_differs():
    assert run_of("actor=popsan", "actor.name=bptsan").label == "bptsan-dendritic.branches=1,lateral.radius=0"


@pytest.mark.parametrize(
    ("overrides", "tail"),
    [
        ((), "results/paper/runs/td3/hopper/bptsan/poisson/seed_0"),
        (("env=ant", "seed=3", "protocol=short"), "results/short/runs/td3/ant/bptsan/deterministic/seed_3"),
        (("actor=aan", "algo=sac", "study=s"), "results/s/runs/sac/hopper/aan/none/seed_0"),
    ],
)
def test_the_path_is_the_contracts(overrides, tail):
    assert str(run_of(*overrides).path).endswith(tail)
