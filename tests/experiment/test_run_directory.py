"""If these fail, a manifest can be half written, or tell other things than its contract."""

import json
import re
import signal
import subprocess
import sys
import time

import pytest

from src.experiment.ownership import acquire
from src.experiment.run_directory import Failure, ManifestError, RunDirectory
from tests.experiment.runs import ROOT, smoke


def test_the_keys_are_the_contracts(tmp_path):
    page = (ROOT / "docs" / "run-directory.md").read_text()
    table = page[page.index("## manifest.json") : page.index("## training.csv")]
    first_cells = re.findall(r"^\| ([^|]*) \|", table, flags=re.MULTILINE)
    documented = {key for first_cell in first_cells for key in re.findall(r"`(\w+)`", first_cell)}
    with acquire(smoke(tmp_path)) as (run, _):
        written = json.loads((run.path / "manifest.json").read_text())
    assert set(written) == documented


def test_nothing_in_a_run_directory_names_the_machine(tmp_path):
    import socket

    with acquire(smoke(tmp_path)) as (run, _):
        pass
    for name in ("manifest.json", "config.yaml"):
        text = (run.path / name).read_text()
        assert str(ROOT) not in text and str(tmp_path) not in text
        assert f'"{socket.gethostname()}"' not in text and f" {socket.gethostname()}\n" not in text


def test_reading_back_is_exact(tmp_path):
    with acquire(smoke(tmp_path)) as (run, _):
        run.update_manifest(status="diverged", failure=Failure("diverged", "nan", 50), notes=["a"])
    assert run.read_manifest() == run.manifest


def test_an_unreadable_manifest_says_what_to_do(tmp_path):
    directory = RunDirectory(tmp_path)
    assert directory.read_manifest() is None
    for content in ("", "{", "[]", '{"format": 1}', '{"format": 99}'):
        (tmp_path / "manifest.json").write_text(content)
        with pytest.raises(ManifestError, match=r"manifest\.json"):
            directory.read_manifest()


WRITER = """
import sys
from src.experiment.run_directory import RunDirectory
from pathlib import Path
run = RunDirectory(Path(sys.argv[1]))
for step in range(10**6):
    run.update_manifest(step=step, notes=["x" * 20000])
"""


def test_a_kill_at_any_moment_leaves_a_whole_manifest(tmp_path):
    with acquire(smoke(tmp_path)) as (run, _):
        pass
    for attempt in range(5):
        before = (run.path / "manifest.json").stat().st_mtime_ns
        writer = subprocess.Popen([sys.executable, "-c", WRITER, str(run.path)], cwd=ROOT)
        while (run.path / "manifest.json").stat().st_mtime_ns == before and writer.poll() is None:
            time.sleep(0.005)
        time.sleep(0.02 * attempt)
        writer.send_signal(signal.SIGKILL)
        writer.wait()
        assert run.read_manifest() is not None
        assert len(run.read_manifest().notes[0]) == 20000


def test_a_failed_replacement_leaves_the_old_file_and_no_litter(tmp_path, monkeypatch):
    from src.experiment import files

    path = tmp_path / "file"
    files.replace_file(path, b"old")
    monkeypatch.setattr(files.os, "fsync", lambda _: (_ for _ in ()).throw(OSError(28, "full")))
    with pytest.raises(OSError, match="full"):
        files.replace_file(path, b"new")
    assert path.read_bytes() == b"old" and list(tmp_path.iterdir()) == [path]
