"""Runs of earlier commits, kept as they were written: if these fail, what people have trained is worth nothing here.

``tests/fixtures/engine_<k>`` is a study of two tiny runs of the commit that introduced engine k (3: 9461f89). A new
engine adds a folder; none is ever written again.
"""

from __future__ import annotations

import dataclasses
import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import torch
import yaml

from src.config.identity import Run
from src.config.validation import validate
from src.experiment.state import Next, next_action
from src.training.policy_file import TrainedPolicy

FIXTURES = Path(__file__).parent / "fixtures"
RUNS = sorted(path.parent for path in FIXTURES.glob("engine_*/runs/**/manifest.json"))
#: The actions of each final policy at nine observations, as the commit that trained it played them.
ACTIONS = json.loads((FIXTURES / "actions.json").read_text())


def name_of(path: Path) -> str:
    return path.relative_to(FIXTURES).as_posix()


def run_of(path: Path, results: Path) -> Run:
    """The run as this code would name it, in a results folder of the test's."""
    config = validate(yaml.safe_load((path / "config.yaml").read_text()))
    return Run(dataclasses.replace(config, results_dir=str(results)))


@pytest.fixture
def study(tmp_path: Path, request: pytest.FixtureRequest) -> tuple[Run, Path]:
    """A copy where a command may look at it: a run and its directory."""
    path: Path = request.param
    shutil.copytree(FIXTURES / path.relative_to(FIXTURES).parts[0], tmp_path / path.relative_to(FIXTURES).parts[0])
    return run_of(path, tmp_path), tmp_path / path.relative_to(FIXTURES)


@pytest.mark.parametrize("study", RUNS, ids=name_of, indirect=True)
def test_a_complete_run_of_this_engine_is_found_and_skipped(study: tuple[Run, Path]) -> None:
    run, path = study
    assert run.path == path
    assert json.loads((path / "manifest.json").read_text())["configuration_hash"] == run.configuration_hash
    assert next_action(run).action is Next.SKIP


@pytest.mark.parametrize("name", ["policy.pt", "policy_best.pt"])
@pytest.mark.parametrize("path", RUNS, ids=name_of)
def test_its_policies_load_and_act_as_they_did(path: Path, name: str) -> None:
    policy = TrainedPolicy(path / name)
    observation = torch.linspace(-1, 1, 9 * 11).view(9, 11)
    actions = policy.act(observation, torch.Generator().manual_seed(0))
    expected = torch.tensor(ACTIONS[f"{name_of(path)}/{name}"])
    # Another BLAS may tip a potential at the threshold: one observation in nine may differ for a spiking actor.
    alike = (actions - expected).abs().amax(dim=1) < 1e-4
    assert int(alike.sum()) >= 8


def test_the_study_stands_in_a_report(tmp_path: Path) -> None:
    shutil.copytree(FIXTURES / "engine_3", tmp_path / "engine_3")
    command = [sys.executable, "-m", "analysis", "report", str(tmp_path / "engine_3")]
    done = subprocess.run(command, capture_output=True, text=True, cwd=FIXTURES.parents[1])
    assert done.returncode == 0, done.stderr
    report = (tmp_path / "engine_3" / "report" / "report.md").read_text()
    assert "bptsan" in report.lower() or "BPT-SAN" in report
