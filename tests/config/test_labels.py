"""If these fail, a variant passes for the paper's own actor in paths and reports."""

import re

import pytest

from src.config.identity import LONGEST_LABEL
from src.config.schema import ConfigurationError
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


@pytest.mark.parametrize(
    "overrides",
    [
        ("actor=aan", "encoder.population_size=20"),
        ("actor=aan", "encoder.std=0.5", "encoder.learnable=false"),
        ("encoder.threshold=0.9",),  # Hopper's coding is poisson
        ("actor=aan", "actor.log_std_network=separate"),  # TD3 has no standard deviation
        ("algo=sac", "actor=aan", "algo.log_std_learning_rate=1e-4"),  # the trunk's is the actor's
        ("actor=popsan", "actor.mask_seed=7"),  # no dendrites
        ("actor=popsan", "actor.lateral.init_scale=1.0"),  # no lateral interaction
        ("normalize_observations=false", "normalization_clip=5.0"),
    ],
)
def test_a_key_that_changes_nothing_makes_no_variant(overrides):
    groups = {"actor=aan", "actor=popsan", "algo=sac", "normalize_observations=false"}
    run = run_of(*overrides)
    without = run_of(*(each for each in overrides if each in groups))
    assert (run.label, run.changed_keys, run.configuration_hash) == (
        without.label,
        without.changed_keys,
        without.configuration_hash,
    )


def test_the_same_key_makes_one_where_it_does_something():
    assert run_of("env=ant", "encoder.threshold=0.9").label == "bptsan-encoder.threshold=0.9"
    assert run_of("algo=sac", "actor=aan", "algo.log_std_network=separate").label != "aan"


OPTIONS = {
    "actor/mine.yaml": "defaults: [bptsan, _self_]\nname: mine\nlateral: {radius: 4}\n",
    "actor/nameless.yaml": "defaults: [bptsan, _self_]\nlateral: {radius: 4}\n",
    "env/mytask.yaml": "defaults: [ant, _self_]\nname: mytask\nmax_episode_steps: 500\n",
    "encoder/wide.yaml": "defaults: [poisson, _self_]\npopulation_size: 20\n",
}


@pytest.fixture
def options(tmp_path):
    """Options of a user's own, on a search path of their own."""
    for name, text in OPTIONS.items():
        path = tmp_path / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(text)
    return f"hydra.searchpath=[file://{tmp_path}]"


def test_an_actor_that_inherits_is_labelled_by_its_name(options):
    run = run_of(options, "actor=mine")
    assert (run.label, run.changed_keys) == ("mine", {})
    assert run_of(options, "actor=mine", "actor.lateral.radius=2").label == "mine-lateral.radius=2"


def test_one_that_keeps_the_name_of_the_papers_actor_does_not_pass_for_it(options):
    assert run_of(options, "actor=nameless").label == "bptsan-lateral.radius=4"


def test_a_task_that_inherits_makes_no_variant(options):
    run = run_of(options, "env=mytask")
    assert (run.label, run.path.parts[-4], run.config.env.kwargs) == ("bptsan", "mytask", {"use_contact_forces": True})


def test_an_encoder_that_inherits_shows_what_it_changes(options):
    assert run_of(options, "encoder=wide").label == "bptsan-encoder.population_size=20"
