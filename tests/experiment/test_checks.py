"""If these fail, a mistake that could be known before the start costs a queue of failed jobs."""

import dataclasses
import importlib.util
import subprocess
import sys

import pytest

from src.config.schema import ConfigurationError, EnvConfig
from src.experiment import plan
from src.experiment.plan import make_plan
from tests.experiment.command import run
from tests.experiment.runs import ROOT, changed, smoke


def with_env(results, **keys):
    one = smoke(results)
    return changed(one, env=dataclasses.replace(one.config.env, **keys))


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"id": "Hopper-v99"}, r"env\.id: Gymnasium has no task Hopper-v99"),
        ({"kwargs": {"no_such": 1}}, r"env\.kwargs: Hopper-v4 does not take \{'no_such': 1\}"),
        ({"kwargs": {"reset_noise_scale": "wide"}}, r"env: Hopper-v4 with .* fails at its first step"),
        ({"id": "Pendulum-v1"}, r"env\.id: Pendulum-v1 is no MuJoCo task"),
        ({"id": "CartPole-v1"}, r"env\.id: CartPole-v1 acts in"),
    ],
)
def test_a_task_that_cannot_be_built_here_is_refused_in_the_plan(tmp_path, keys, said):
    with pytest.raises(ConfigurationError, match=said):
        make_plan([with_env(tmp_path, **keys)])


def test_each_distinct_task_is_built_once(tmp_path, monkeypatch):
    built: list[EnvConfig] = []
    monkeypatch.setattr(plan, "build_task", built.append)
    make_plan([smoke(tmp_path, f"seed={seed}") for seed in range(3)] + [smoke(tmp_path, "actor=aan")])
    assert len(built) == 1


def test_a_logger_that_is_not_installed_is_refused_in_the_plan(tmp_path, monkeypatch):
    find = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name, *rest: None if name == "wandb" else find(name, *rest))
    with pytest.raises(ConfigurationError, match="logger=wandb: wandb is not installed; run: pip install"):
        make_plan([smoke(tmp_path, "logger=wandb")])


@pytest.mark.parametrize(("device", "gpus"), [("cuda", 0), ("cuda:1", 1), ("cuda:0", 0)])
def test_a_gpu_that_is_not_here_is_refused_where_the_runs_train_here(tmp_path, monkeypatch, device, gpus):
    monkeypatch.setattr(plan, "gpu_count", lambda: gpus)
    one = changed(smoke(tmp_path), device=device)
    with pytest.raises(ConfigurationError, match=f"device: {device} is asked for and PyTorch finds"):
        make_plan([one], gpus_here=True)
    assert make_plan([one]).to_do, "a cluster's nodes may have one"


def test_a_gpu_that_is_here_is_taken(tmp_path, monkeypatch):
    monkeypatch.setattr(plan, "gpu_count", lambda: 2)
    assert make_plan([changed(smoke(tmp_path), device="cuda:1")], gpus_here=True).to_do


@pytest.mark.parametrize("arguments", [["device=cuda"], ["-m", "device=cuda", "seed=0,1"]])
def test_the_command_refuses_a_gpu_that_is_not_there(tmp_path, arguments):
    """The pretending trainer's processes can't import torch, so there is none for them."""
    done = run(tmp_path, "protocol=smoke", *arguments)
    assert done.code == 2 and "PyTorch finds no CUDA GPU; use cpu" in done.err, done
    assert not (tmp_path / "smoke").exists()


def test_the_plan_imports_no_torch(tmp_path):
    code = (
        "import sys; from tests.experiment.runs import smoke; from src.experiment.plan import make_plan; "
        "make_plan([smoke('/nowhere', 'env=ant')]); sys.exit('torch' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], cwd=ROOT).returncode == 0


@pytest.mark.parametrize(
    "sweeper", [("hydra/sweeper=basic",), ("hydra/sweeper=basic", "hydra/launcher=basic"), ("hydra/launcher=basic",)]
)
def test_dry_run_trains_nothing_under_any_sweeper_and_launcher(tmp_path, sweeper):
    done = run(tmp_path, "-m", *sweeper, "protocol=smoke", "seed=0,1", "dry_run=true")
    assert done.code == 0 and "to do" in done.out, done
    assert not (tmp_path / "smoke").exists()


def test_the_plan_of_one_run_prints_its_path(tmp_path):
    done = run(tmp_path, "protocol=smoke", "dry_run=true", "seed=4")
    assert str(tmp_path / "smoke/runs/td3/hopper/bptsan/poisson/seed_4") in done.out, done
