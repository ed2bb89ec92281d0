"""If these fail, a study's claims file names labels that its sweep does not train, or its verdicts wait for ever."""

from itertools import product
from pathlib import Path

import pytest
from omegaconf import OmegaConf

from analysis.claims_file import read_claims
from tests.experiment.runs import run_of

ROOT = Path(__file__).resolve().parents[2]


def swept(name):
    """Labels, tasks and the number of seeds that a sweep file trains."""
    params = OmegaConf.load(ROOT / f"sweeps/{name}.yaml").hydra.sweeper.params
    varied = {key: str(value).split(",") for key, value in params.items() if key not in ("seed", "env", "study")}
    labels = {run_of(*map("=".join, zip(varied, values))).label for values in product(*varied.values())}
    return labels, set(params.env.split(",")), int(params.seed.removeprefix("range(").removesuffix(")"))


@pytest.mark.parametrize(("sweep", "study"), [("controls_td3", "controls_td3"), ("rivals_td3", "rivals_100k")])
def test_the_plan_names_what_the_sweep_trains(sweep, study):
    claims = read_claims(ROOT / "results" / study / "claims.yaml")
    labels, tasks, seeds = swept(sweep)
    assert {arm for claim in claims.claims for arm in claim.arms} <= labels
    assert set(claims.baselines) <= labels and set(claims.tasks) == tasks and claims.planned_seeds == seeds


def test_each_control_of_the_controls_says_what_it_removes():
    first, *controls = read_claims(ROOT / "results/controls_td3/claims.yaml").claims
    assert not first.removes and all(claim.removes for claim in controls)
    removed = {name for claim in controls for name in claim.removes}
    assert {"the learning rate", "the number of parameters", "the population code"} < removed
