"""If these fail, normalised scores have another zero or hundred than the page says."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.claims_file import read_claims
from analysis.data.cells import cells_of
from analysis.data.study import read_study
from analysis.references import Scale, normalised, references, scale
from benchmarks.synthetic import write_run

CLAIMS = read_claims()


def test_random_policy_scores_zero_and_the_reference_hundred():
    for algo in ("td3", "sac"):
        for env in ("hopper", "walker2d", "halfcheetah", "ant"):
            ends = np.array([references()["random_policy"][env]["mean"], references()["aan_reference"][algo][env]])
            assert normalised([], ends, algo, env, CLAIMS) == pytest.approx([0, 100])


def test_an_algorithm_without_reference_takes_the_studys_own_aan(tmp_path):
    for seed, level in enumerate((1000.0, 3000.0)):
        write_run(tmp_path / "s", actor="aan", seed=seed, curve=np.full(11, level), manifest={"algo": "ddpg"})
    (tmp_path / "s/runs/td3").rename(tmp_path / "s/runs/ddpg")
    cells = cells_of(read_study(tmp_path / "s"))
    assert scale(cells, "ddpg", "hopper", CLAIMS) == Scale(19.43, 2000.0, own=True)
    assert scale(cells, "ddpg", "ant", CLAIMS) is None  # neither a reference nor a run
    with pytest.raises(KeyError):
        normalised(cells, np.zeros(1), "ddpg", "ant", CLAIMS)


def test_an_aan_no_better_than_chance_is_no_reference(tmp_path):
    write_run(tmp_path / "s", actor="aan", curve=np.full(11, 19.0), manifest={"algo": "ddpg"})
    (tmp_path / "s/runs/td3").rename(tmp_path / "s/runs/ddpg")
    assert scale(cells_of(read_study(tmp_path / "s")), "ddpg", "hopper", CLAIMS) is None


def test_a_studys_own_scores_go_before_the_committed_ones():
    own = replace(CLAIMS, reference_scores={"hopper": {"td3": 1019.43}, "swimmer": {"random": 1.0, "sac": 101.0}})
    assert scale([], "td3", "hopper", own) == Scale(19.43, 1019.43)
    assert scale([], "sac", "swimmer", own) == Scale(1.0, 101.0)
    assert scale([], "td3", "swimmer", own) is None and scale([], "sac", "swimmer", CLAIMS) is None
