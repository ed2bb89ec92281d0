"""If these fail, runs of different configurations share a directory, or a finished grid is trained again."""

import copy

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from src.config.identity import ADDED_KEYS, differences, flatten, hashed_values
from src.config.schema import ENGINE
from src.config.validation import to_dict
from tests.experiment.runs import changed, run_of


@pytest.mark.parametrize(
    "override",
    [
        "logger=none",
        "results_dir=elsewhere",
        "study=other",
        "label=mine",
        "on_conflict=replace",
        "dry_run=true",
        "keep_replay=true",
        "protocol.total_steps=2_000_000",
        "protocol.checkpoint_interval=20_000",
        "protocol.name=mine",
        "encoder=poisson",  # what encoder=task is on Hopper
        "backend=fast",  # what backend=auto takes where it can
    ],
)
def test_what_changes_no_number_keeps_the_hash(override):
    assert run_of(override).configuration_hash == run_of().configuration_hash


@pytest.mark.parametrize(
    "override",
    [
        "seed=1",
        "threads=2",
        "device=cuda",
        "actor=popsan",
        "algo=sac",
        "env=walker2d",
        "encoder=deterministic",
        "actor.lateral.radius=1",
        "normalize_observations=false",
        "backend=plain",
        "protocol.start_steps=5000",
        "protocol.evaluation_episodes=5",
        "+env.kwargs.reset_noise_scale=0.1",
    ],
)
def test_what_changes_numbers_changes_the_hash(override):
    assert run_of(override).configuration_hash != run_of().configuration_hash


def test_the_engine_is_part_of_the_hash(monkeypatch):
    before = run_of().configuration_hash
    monkeypatch.setattr("src.config.identity.ENGINE", 10**6)
    assert changed(run_of()).configuration_hash != before


def test_all_seeds_of_a_cell_share_the_cell_hash_and_nothing_else_does():
    assert run_of("seed=1").cell_hash == run_of("seed=2").cell_hash
    assert run_of("threads=2").cell_hash != run_of().cell_hash
    assert run_of().cell_hash != run_of().configuration_hash


def test_the_hash_is_the_same_in_another_process_and_another_year():
    """A hash that depends on dictionary order or on the interpreter's salt would retrain every finished grid."""
    import hashlib
    import json

    flat = {"engine": ENGINE, **hashed_values(to_dict(run_of().config))}
    again = json.dumps(dict(sorted(flat.items(), reverse=True)), sort_keys=True, separators=(",", ":"))
    assert run_of().configuration_hash == hashlib.sha256(again.encode()).hexdigest()


KEYS = sorted(hashed_values(to_dict(run_of().config)))


@given(st.sampled_from(KEYS), st.sampled_from(KEYS))
def test_differences_names_exactly_what_was_changed(first, second):
    old = to_dict(run_of().config)
    new = copy.deepcopy(old)
    for key in {first, second}:
        *parents, last = key.split(".")
        place = new
        for parent in parents:
            place = place[parent]
        place[last] = "changed"
    found = differences(hashed_values(old), hashed_values(new))
    assert [each.key for each in found] == sorted({first, second})
    assert all(each.old == hashed_values(old)[each.key] and each.new == "changed" for each in found)


nested = st.recursive(st.integers(), lambda inner: st.dictionaries(st.text("abc", min_size=1), inner), max_leaves=5)


@settings(max_examples=50)
@given(st.dictionaries(st.text("abc", min_size=1), nested), st.dictionaries(st.text("abc", min_size=1), nested))
def test_flattening_keeps_different_things_different(one, other):
    assert (flatten(one) == flatten(other)) == (one == other)


def test_a_key_added_later_enters_hash_and_comparison_only_where_it_departs(monkeypatch):
    """Without this a new key with its default would make every finished run another configuration."""
    run = run_of()
    before = run.configuration_hash
    content = to_dict(run.config)
    monkeypatch.setattr(
        "src.config.identity.ADDED_KEYS", {**ADDED_KEYS, "new": ("auto", "fast"), "actor.newer": (False,)}
    )
    for values in ({"new": "auto"}, {"new": "fast"}):
        added = {**content, **values, "actor": {**content["actor"], "newer": False}}
        assert hashed_values(added) == hashed_values(content)
        assert differences(hashed_values(content), hashed_values(added)) == []
    departed = hashed_values({**content, "new": "plain"})
    assert [str(each) for each in differences(hashed_values(content), departed)] == ["new: None -> plain"]
    assert changed(run).configuration_hash == before


def test_every_key_with_a_default_in_the_schema_is_out_of_the_hash_or_in_the_table():
    """Such a key came later: configurations of before lack it, and must keep their hash."""
    from dataclasses import MISSING, fields

    from src.config import schema
    from src.config.identity import _EXCLUDED, ADDED_KEYS

    for group in ("", "algo", "env", "encoder", "protocol"):
        classes = {"": ["Experiment"], "algo": ["TD3", "SAC"]}.get(group, [group.capitalize()])
        for name in classes:
            for each in fields(getattr(schema, f"{name}Config")):
                key = f"{group}.{each.name}".lstrip(".")
                if each.default is not MISSING or each.default_factory is not MISSING:
                    assert key in _EXCLUDED or each.default in ADDED_KEYS[key], key


def test_the_manifest_lists_the_keys_that_entered_the_hash(tmp_path):
    from src.experiment.ownership import acquire
    from tests.experiment.runs import smoke

    with acquire(smoke(tmp_path)) as (directory, _):
        listed = directory.read_manifest().hashed_keys
    assert listed == sorted(hashed_values(directory.read_config()))
    assert {"seed", "actor.lateral.radius"} <= set(listed) and not {"study", "blas", "logger.name"} & set(listed)
