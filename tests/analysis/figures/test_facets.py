"""If these fail, an actor of one's own is drawn alone, without the baselines, or not at all."""

import json

import pandas as pd
import pytest

from analysis.__main__ import main
from analysis.claims_file import read_claims
from analysis.figures.facets import MOST, facets
from benchmarks.synthetic import write_run


@pytest.mark.parametrize("others", [1, 5, 6, 11, 30])
def test_every_label_has_a_panel_and_the_baselines_stand_in_each(others):
    arms = ["aan", "popsan", *(f"mine{k}" for k in range(others))]
    groups = facets(arms, read_claims())
    assert {arm for group in groups for arm in group} == set(arms)
    for group in groups:
        assert group[:2] == ["aan", "popsan"] and 3 <= len(group) <= MOST
    sizes = [len(group) for group in groups]
    assert max(sizes) - min(sizes) <= 1


def test_without_baselines_no_label_is_alone():
    groups = facets([f"mine{k}" for k in range(MOST + 1)], read_claims())
    assert min(map(len, groups)) >= 2


@pytest.fixture(scope="module")
def own(tmp_path_factory):
    """An actor of one's own with two variants beside the AAN; no label of the paper's spiking actors."""
    study = tmp_path_factory.mktemp("own") / "s"
    for seed in range(3):
        write_run(study, actor="aan", seed=seed, noise=50)
        for label, change in (
            ("mine", {}),
            ("mine_wo_memory", {}),
            ("mine-lateral.radius=4", {"actor.lateral.radius": 4}),
        ):
            actor = label.partition("-")[0]
            write_run(study, seed=seed, label=label, changes=change, manifest={"actor": actor}, noise=50)
    assert main(["report", str(study)]) == 0
    return study


def test_an_actor_of_ones_own_stands_in_the_first_table_and_in_every_panel(own):
    tables = {t["name"]: t for t in json.loads((own / "statistics/tables.json").read_text())["tables"]}
    assert [row[1] for row in tables["main"]["rows"]] == ["AAN", "mine", "mine-lateral.radius=4", "mine_wo_memory"]
    curves = pd.read_csv(own / "figures/main-td3.csv")
    assert set(curves["arm"]) == {"aan", "mine", "mine-lateral.radius=4", "mine_wo_memory"}


def test_the_ablation_draws_the_variants_of_any_base(own):
    bars = pd.read_csv(own / "figures/ablation-td3-mine.csv")
    assert bars["arm"].tolist() == ["mine", "mine-lateral.radius=4", "mine_wo_memory"]
