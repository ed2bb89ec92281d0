"""If these fail, a study stands beside a published number that is of something else, or nothing says why not."""

import numpy as np
import pytest

from analysis.data.cells import cells_of
from analysis.data.study import read_study
from analysis.statistics.published import published_table
from benchmarks.synthetic import write_run

#: Its curve has the maximum 3000 at half of the steps and ends at 2000.
CURVE = np.r_[np.linspace(0, 3000, 6), np.full(5, 2000.0)]


def table(study):
    return published_table(cells_of(read_study(study)))


def run(study, **options):
    options = {"total_steps": 1_000_000, "interval": 100_000, "curve": CURVE, "actor": "aan"} | options
    return write_run(study, **options)


def sources(found):
    return sorted(set(found.frame["source"].str.split(" \\(").str[0]))


def test_equal_statistics_stand_beside_one_another(tmp_path):
    for seed in range(2):
        run(tmp_path / "s", seed=seed)
    frame = table(tmp_path / "s").frame.set_index("source")
    assert frame["statistic"].to_dict() == {
        "Proxy Target paper (Xu et al., NeurIPS 2025)": "max_of_mean",
        "MDC-SAN paper (Zhang et al., AAAI 2022)": "max_of_mean",
        "OpenAI Spinning Up (Achiam, 2018)": "final",
    }
    assert frame["mean"].tolist() == [3000.0, 3000.0, 2000.0]
    assert frame["published_mean"].tolist() == [3410, 3396, 2859]
    assert frame["published_task"].tolist() == ["Hopper-v4", "Hopper-v3", "Hopper-v3"]
    assert frame["published"].tolist()[1:] == ["3,396 (n=10, std not stated)", "2,859 ± 1,033 (n not stated)"]
    assert frame["ours"].tolist()[0] == "3,000 ± 0 (n=2)"


def test_a_proxy_target_stands_beside_proxy_targets_only_under_either_label(tmp_path):
    run(tmp_path / "a", actor="popsan", algo="td3_proxy")
    assert table(tmp_path / "a").frame["published_actor"].tolist() == ["PT-CLIF"]
    run(tmp_path / "b", actor="popsan", algo="td3_proxy", label="popsan_pt", total_steps=1_025_000, interval=25_000,
        curve=np.full(42, 1.0), changes={"algo.batch_size": 256})  # fmt: skip
    assert table(tmp_path / "b").frame["published_actor"].tolist() == ["PT-CLIF"]
    run(tmp_path / "c", actor="popsan")
    assert set(table(tmp_path / "c").frame["published_actor"]) == {"PopSAN"}


def test_a_changed_actor_and_an_unfinished_run_stand_beside_nothing(tmp_path):
    run(tmp_path / "s", actor="popsan", changes={"actor.lateral.radius": 2})
    assert "is of an actor of this study" in table(tmp_path / "s").empty
    run(tmp_path / "t", status="running", stop=500_000, curve=CURVE[:6])
    assert table(tmp_path / "t").empty == "No run that could stand beside a published number has finished."


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"total_steps": 100_000, "interval": 10_000}, "This study's runs have 100,000 steps; published numbers of its "
            "actors are after 1,000,000."),
        ({"actor": "bptsan"}, "No published number under these algorithms is of an actor of this study (BPT-SAN)."),
        ({"manifest": {"env": "hopper_v5"}}, "This study's tasks are Hopper-v5; published numbers of its actors are on "
            "Hopper, Walker2d, HalfCheetah, Ant."),
        ({"manifest": {"algo": "ddpg"}}, "No published number is of DDPG."),
    ],
)  # fmt: skip
def test_where_nothing_matches_one_sentence_says_which_requirement_fails(tmp_path, options, sentence):
    folder = run(tmp_path / "s", **options)
    moved = options.get("manifest", {})
    algo, env = moved.get("algo", "td3"), moved.get("env", "hopper")
    target = tmp_path / "s/runs" / algo / env / folder.relative_to(tmp_path / "s/runs/td3/hopper")
    if target != folder:
        target.parent.mkdir(parents=True)
        folder.rename(target)
        (tmp_path / "s/runs/td3/hopper/aan/none").rmdir()
    found = table(tmp_path / "s")
    assert found.empty == sentence and not found.rows()


def test_without_runs_it_says_so():
    assert published_table([]).empty == "No runs, so nothing stands beside published numbers."


def test_ants_of_other_dimensions_are_other_tasks(tmp_path):
    run(tmp_path / "s", env="ant")
    found = table(tmp_path / "s")
    assert sources(found) == ["MDC-SAN paper", "OpenAI Spinning Up"]
    assert found.caption.endswith("as those of Ant-v4 (N=111, contacts 0).")
