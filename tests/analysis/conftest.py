"""Studies that several tests read; built once."""

import shutil

import pytest

from benchmarks.synthetic import write_grid, write_run


@pytest.fixture(scope="session")
def mixed_source(tmp_path_factory):
    """Two tasks under TD3 with everything that can go wrong in a study without being an error."""
    study = tmp_path_factory.mktemp("source") / "mixed"
    write_grid(study, {"bptsan": 900.0}, envs=("hopper", "ant"), seeds=3)
    shutil.rmtree(study / "runs/td3/ant/popsan/deterministic/seed_2")  # missing
    shutil.rmtree(study / "runs/td3/hopper/bptsan/poisson/seed_2")
    write_run(study, "td3", "hopper", "bptsan", 2, status="diverged", stop=40_000, level=1000)
    write_run(study, "td3", "hopper", "bptsan", 3, status="running", stop=50_000)
    for radius in (1, 4):
        for seed in range(3):
            write_run(
                study,
                "td3",
                "hopper",
                "bptsan",
                seed,
                label=f"bptsan-lateral.radius={radius}",
                changes={"actor.lateral.radius": radius},
                level=3000 + 100 * radius,
                noise=50,
            )
    (study / "runs" / "my notes").mkdir()
    return study


@pytest.fixture
def mixed(mixed_source, tmp_path):
    """A copy of it to write into."""
    return shutil.copytree(mixed_source, tmp_path / "mixed")


@pytest.fixture(scope="session")
def mixed_report(mixed_source, tmp_path_factory):
    """The same study with its report."""
    from analysis.__main__ import main

    study = shutil.copytree(mixed_source, tmp_path_factory.mktemp("report") / "mixed")
    assert main(["report", str(study)]) == 0
    return study
