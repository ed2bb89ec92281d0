"""One cluster for all tests; where the packages are missing they are skipped and say so."""

import pytest

from tests.slurm.cluster import Cluster, why_not


@pytest.fixture(scope="session")
def running_cluster():
    if reason := why_not():
        pytest.skip(reason)
    cluster = Cluster()
    try:
        yield cluster.start()
    finally:
        cluster.stop()


@pytest.fixture
def cluster(running_cluster):
    """The cluster with an empty queue, before and after."""
    yield running_cluster
    running_cluster.cancel_all()


@pytest.fixture
def gate(tmp_path):
    """The folder of a closed gate."""
    folder = tmp_path / "gate"
    folder.mkdir()
    return folder
