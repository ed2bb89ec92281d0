"""If these fail, normalised scores have another zero or hundred than the page says."""

import numpy as np
import pytest

from analysis.data.cells import cells_of
from analysis.data.study import read_study
from analysis.references import Scale, normalised, references, scale
from benchmarks.synthetic import write_run


def test_random_policy_scores_zero_and_the_reference_hundred():
    for algo in ("td3", "sac"):
        for env in ("hopper", "walker2d", "halfcheetah", "ant"):
            ends = np.array([references()["random_policy"][env]["mean"], references()["aan_reference"][algo][env]])
            assert normalised([], ends, algo, env) == pytest.approx([0, 100])


def test_an_algorithm_without_reference_takes_the_studys_own_aan(tmp_path):
    for seed, level in enumerate((1000.0, 3000.0)):
        write_run(tmp_path / "s", actor="aan", seed=seed, curve=np.full(11, level), manifest={"algo": "td3_proxy"})
    (tmp_path / "s/runs/td3").rename(tmp_path / "s/runs/td3_proxy")
    cells = cells_of(read_study(tmp_path / "s"))
    assert scale(cells, "td3_proxy", "hopper") == Scale(19.43, 2000.0, own=True)
    assert scale(cells, "td3_proxy", "ant") is None  # neither a reference nor a run
    with pytest.raises(KeyError):
        normalised(cells, np.zeros(1), "td3_proxy", "ant")


def test_an_aan_no_better_than_chance_is_no_reference(tmp_path):
    write_run(tmp_path / "s", actor="aan", curve=np.full(11, 19.0), manifest={"algo": "td3_proxy"})
    (tmp_path / "s/runs/td3").rename(tmp_path / "s/runs/td3_proxy")
    assert scale(cells_of(read_study(tmp_path / "s")), "td3_proxy", "hopper") is None
