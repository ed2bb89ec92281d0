"""If these fail, a proxy target counts as another algorithm, or passes for none."""

from pathlib import Path

from analysis.data.cells import cells_of
from analysis.data.confounds import confounds
from analysis.data.study import read_study
from benchmarks.synthetic import write_run


def test_with_and_without_a_proxy_target_are_two_arms_of_td3(tmp_path: Path) -> None:
    for algo in ("td3", "td3_proxy"):
        for seed in range(2):
            write_run(tmp_path / "s", algo=algo, actor="popsan", seed=seed, noise=1)
    study = read_study(tmp_path / "s")
    assert [(cell.algo, cell.arm, cell.n) for cell in cells_of(study)] == [
        ("td3", "popsan", 2),
        ("td3", "popsan + proxy target", 2),
    ]
    assert study.runs["paper"].tolist() == [True, True, False, False]
    assert confounds(study, "td3", "hopper", ("popsan", "popsan + proxy target")) == []


def test_other_differences_are_still_confounds(tmp_path: Path) -> None:
    write_run(tmp_path / "s", actor="popsan")
    write_run(
        tmp_path / "s", algo="td3_proxy", actor="popsan", changes={"algo.batch_size": 7}, manifest={"changed_keys": {}}
    )
    (found,) = confounds(read_study(tmp_path / "s"), "td3", "hopper", ("popsan", "popsan + proxy target"))
    assert found.startswith("algo.batch_size (100")


def test_an_actor_that_always_takes_analog_input_is_itself_on_every_task(tmp_path: Path) -> None:
    """Analog input of another actor is an arm of its own."""
    write_run(tmp_path / "s", actor="mdcsan")
    write_run(tmp_path / "s", actor="popsan", encoder="analog")
    assert sorted(cell.arm for cell in cells_of(read_study(tmp_path / "s"))) == ["mdcsan", "popsan [analog]"]
