"""If these fail, the seeds of one label train under two configurations, and the report refuses them afterwards."""

import json

import pytest

from src import status
from src.config.schema import ConfigurationError
from src.experiment.ownership import acquire
from src.experiment.plan import make_plan
from tests.experiment.command import run
from tests.experiment.runs import changed, smoke


def ended(results, *overrides, **changes):
    one = smoke(results, *overrides)
    with acquire(one) as (directory, _):
        directory.update_manifest(**{"status": "complete", "step": one.config.protocol.total_steps, **changes})
    return one, directory


@pytest.mark.parametrize(
    ("key", "shown"),
    [
        ("protocol.evaluation_interval=250", "protocol.evaluation_interval: 500 -> 250"),
        ("protocol.total_steps=4000", "protocol.total_steps: 2000 -> 4000"),
        ("threads=2", "threads: 1 -> 2"),
    ],
)
def test_another_seed_with_another_configuration_is_refused(tmp_path, key, shown):
    ended(tmp_path, "actor=aan")
    with pytest.raises(ConfigurationError) as refused:
        make_plan([smoke(tmp_path, "actor=aan", "seed=3", key)])
    text = str(refused.value)
    assert "td3/hopper/aan/none/seed_3 and seed 0, which is there already" in text and shown in text
    assert "study=" in text and "label=" in text


def test_an_explicit_label_is_one_configuration_too(tmp_path):
    ended(tmp_path, "label=mix", "actor.lateral.radius=1")
    with pytest.raises(ConfigurationError, match=r"actor\.lateral\.radius: 1 -> 4"):
        make_plan([smoke(tmp_path, "label=mix", "actor.lateral.radius=4", "seed=1")])


def test_seeds_within_a_grid_are_compared(tmp_path):
    other = smoke(tmp_path, "seed=1", "protocol.evaluation_episodes=5")
    with pytest.raises(ConfigurationError, match=r"seed_1 and seed 0: they differ .*evaluation_episodes: 2 -> 5"):
        make_plan([smoke(tmp_path), other])


def test_a_seed_of_another_engine_is_no_sibling_to_add_to(tmp_path, monkeypatch):
    _, directory = ended(tmp_path)
    directory.update_manifest(engine=2)
    with pytest.raises(ConfigurationError, match="engine: 2 -> 3"):
        make_plan([smoke(tmp_path, "seed=1")])


def test_what_changes_no_number_may_differ_between_seeds(tmp_path):
    ended(tmp_path)
    plan = make_plan([smoke(tmp_path, "seed=1", "protocol.checkpoint_interval=1000", "logger=none")])
    assert len(plan.to_do) == 1


def test_all_seeds_together_may_be_extended_or_replaced(tmp_path):
    for seed in (0, 1):
        _, directory = ended(tmp_path, f"seed={seed}")
        for name in ("replay.bin", "checkpoint-000000002000.pt"):
            (directory.state / name).touch()
    longer = [smoke(tmp_path, f"seed={seed}", "protocol.total_steps=4000") for seed in (0, 1)]
    assert {each.action for each in make_plan(longer).runs} == {"extend"}
    with pytest.raises(ConfigurationError, match="total_steps"):
        make_plan(longer[:1])
    other = [changed(smoke(tmp_path, f"seed={seed}", "threads=2"), on_conflict="replace") for seed in (0, 1)]
    assert {each.action for each in make_plan(other).runs} == {"replace"}


def test_a_broken_sibling_stops_nobody(tmp_path):
    _, directory = ended(tmp_path)
    (directory.path / "manifest.json").write_text("{")
    assert len(make_plan([smoke(tmp_path, "seed=1")]).to_do) == 1


def test_the_command_refuses_before_anything_trains(tmp_path):
    assert run(tmp_path, "-m", "protocol=smoke", "actor=aan", "seed=0").code == 0
    second = run(tmp_path, "-m", "protocol=smoke", "actor=aan", "seed=3", "protocol.evaluation_interval=1000")
    assert second.code == 2 and "protocol.evaluation_interval: 500 -> 1000" in second.err, second
    assert not (tmp_path / "smoke" / "runs" / "td3" / "hopper" / "aan" / "none" / "seed_3").exists()


def test_status_shows_a_row_that_is_not_one_configuration(tmp_path, capsys, monkeypatch):
    """Such rows are of commands before the plan refused them."""
    monkeypatch.setenv("COLUMNS", "200")
    ended(tmp_path)
    ended(tmp_path, "seed=3", "protocol.total_steps=4000")
    assert status.main([str(tmp_path / "smoke")]) == 1
    out = capsys.readouterr().out
    assert "2k/2k..4k" in out
    assert "not one configuration: td3/hopper/bptsan/poisson: seeds 0 and 3 differ in protocol.total_steps" in out
    assert status.main([str(tmp_path / "smoke"), "--json"]) == 1
    assert "protocol.total_steps" in json.loads(capsys.readouterr().out)[0]["mixed"]
