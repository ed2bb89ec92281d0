"""If these fail, finished runs lose their place: a grid is trained again, or refuses the runs that it has.

The hashes are of 16 configurations at engine 2, taken before the house was rebuilt; a later engine changes all of them,
and nothing else may.
"""

from pathlib import Path

import pytest
import yaml

from src.config.identity import Run
from src.config.validation import validate
from src.experiment.run_directory import RunDirectory
from tests.experiment.runs import ROOT, changed, run_of

PINNED = [
    ((), "69e4d3010699ff6a", "results/paper/runs/td3/hopper/bptsan/poisson/seed_0"),
    (("seed=3",), "b761d6f5c1960617", "results/paper/runs/td3/hopper/bptsan/poisson/seed_3"),
    (("actor=popsan",), "581ffab08fb757f6", "results/paper/runs/td3/hopper/popsan/poisson/seed_0"),
    (("actor=aan",), "4177ca30bc9bb3d0", "results/paper/runs/td3/hopper/aan/none/seed_0"),
    (("actor=bptsan_wo_ndt",), "3dc9d1750d9c0adb", "results/paper/runs/td3/hopper/bptsan_wo_ndt/poisson/seed_0"),
    (("actor=bptsan_wo_li",), "30fbec5ff3b575af", "results/paper/runs/td3/hopper/bptsan_wo_li/poisson/seed_0"),
    (("algo=sac",), "65fc1faf852cf35a", "results/paper/runs/sac/hopper/bptsan/poisson/seed_0"),
    (("algo=sac", "actor=aan"), "d9dc0f9846cdc829", "results/paper/runs/sac/hopper/aan/none/seed_0"),
    (("env=ant",), "79fb64208296f70e", "results/paper/runs/td3/ant/bptsan/deterministic/seed_0"),
    (
        ("env=ant_zero_contact", "actor=popsan"),
        "705260d74e203810",
        "results/paper/runs/td3/ant_zero_contact/popsan/deterministic/seed_0",
    ),
    (
        ("env=walker2d", "encoder=deterministic"),
        "94d6d9be2141a435",
        "results/paper/runs/td3/walker2d/bptsan/deterministic/seed_0",
    ),
    (
        ("env=halfcheetah", "protocol=short", "study=td3_100k"),
        "7f3acb45b0f142b2",
        "results/td3_100k/runs/td3/halfcheetah/bptsan/deterministic/seed_0",
    ),
    (
        ("actor.lateral.radius=4",),
        "aff7355c1e3e2e1d",
        "results/paper/runs/td3/hopper/bptsan-lateral.radius=4/poisson/seed_0",
    ),
    (
        ("actor.dendritic.branches=3", "actor.dendritic.bias=branch"),
        "707cb5f93cc18b7c",
        "results/paper/runs/td3/hopper/bptsan-dendritic.branches=3,dendritic.bias=branch/poisson/seed_0",
    ),
    (
        ("normalize_observations=false", "threads=2"),
        "e219ef9c2cc10916",
        "results/paper/runs/td3/hopper/bptsan-normalize_observations=false/poisson/seed_0",
    ),
    (
        ("algo.actor_learning_rate=1e-3", "+env.kwargs.reset_noise_scale=0.1"),
        "91e2e8cde11db5c2",
        "results/paper/runs/td3/hopper/bptsan-algo.actor_learning_rate=0.001,env.kwargs.reset_noise_scale=0.1/poisson/seed_0",
    ),
]


@pytest.fixture(autouse=True)
def _engine_2(monkeypatch):
    monkeypatch.setattr("src.config.identity.ENGINE", 2)


@pytest.mark.parametrize(("overrides", "prefix", "path"), PINNED, ids=lambda value: " ".join(value) if value else "-")
def test_hash_and_path_of_a_configuration_stay(overrides, prefix, path):
    run = changed(run_of(*overrides))  # its hash is not of another engine
    assert run.configuration_hash[:16] == prefix
    assert run.path == ROOT / path


FINISHED = sorted(Path(ROOT / "results").glob("*/runs/*/*/*/*/seed_0"))


@pytest.mark.parametrize("path", FINISHED, ids=lambda path: "/".join(path.parts[-7:]))
def test_a_finished_run_is_still_read_and_keeps_its_hash(path, monkeypatch):
    manifest = RunDirectory(path).read_manifest()
    monkeypatch.setattr("src.config.identity.ENGINE", manifest.engine)
    run = Run(validate(yaml.safe_load((path / "config.yaml").read_text())))
    assert manifest.configuration_hash == run.configuration_hash
    assert manifest.status == "complete" and manifest.step == manifest.total_steps
    assert run.path == path
