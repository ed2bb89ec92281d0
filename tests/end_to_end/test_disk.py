"""No space, too large a file, a read-only folder: the reason is recorded, and the same command goes on later."""

from __future__ import annotations

import json
import multiprocessing
import os
import shutil
import sys
import traceback
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest

from tests.end_to_end.commands import (
    AAN,
    assert_same_end,
    forked,
    limit_file_size,
    manifest,
    mount,
    own_mounts,
    run_here,
    run_of,
    wait_for,
)
from tests.gate import close_gate, open_gate, waiting


def test_a_limit_on_file_sizes(interrupted: Path, reference: Path, tmp_path: Path) -> None:
    """The replay is there already and the reserve fits: the next checkpoint is what is too large."""
    results = shutil.copytree(interrupted, tmp_path / "copy")
    kept = (run_of(results) / "evaluations.csv").read_bytes()
    size = max(each.stat().st_size for each in (run_of(results) / "state").glob("checkpoint-*.pt"))
    code, output = forked(results, *AAN, prepare=partial(limit_file_size, size - 1000))
    assert code == 1 and "a file would grow beyond the limit for files" in output, output
    assert "Traceback" not in output
    assert manifest(results)["status"] == "failed"
    assert "limit for files" in manifest(results)["failure"]["message"]
    assert "File too large" in (run_of(results) / "failure.txt").read_text()
    assert (run_of(results) / "evaluations.csv").read_bytes().startswith(kept)
    assert not list((run_of(results) / "state").glob(".checkpoint-*"))
    code, output = forked(results, *AAN)
    assert code == 0, output
    assert_same_end(results, reference)


def test_a_limit_that_the_replay_meets(tmp_path: Path) -> None:
    code, output = forked(tmp_path, *AAN, "protocol.total_steps=1500", prepare=partial(limit_file_size, 70_000))
    assert code == 1 and "no space for the replay to grow" in output, output
    assert manifest(tmp_path)["failure"]["kind"] == "OSError"


def test_a_full_disk_and_a_read_only_one(reference: Path, tmp_path: Path) -> None:
    """On a file system of 4 MB that only this test's process can see."""
    disk, seen = tmp_path / "disk", tmp_path / "seen"
    disk.mkdir()
    seen.mkdir()
    context = multiprocessing.get_context("forkserver")
    process = context.Process(target=_on_a_small_disk, args=(disk, seen))
    process.start()
    process.join(300)
    if (seen / "not allowed").exists():
        pytest.skip(f"no mount namespace here: {(seen / 'not allowed').read_text()}")
    assert process.exitcode == 0, (seen / "error").read_text() if (seen / "error").exists() else process.exitcode
    told = json.loads((seen / "told.json").read_text())

    code, output = told["full while training"]
    assert code == 1 and "the disk is full" in output and "Traceback" not in output, output
    failed = seen / "full"
    assert manifest(failed)["status"] == "failed" and "the disk is full" in manifest(failed)["failure"]["message"]
    assert "No space left on device" in (run_of(failed) / "failure.txt").read_text()
    rows = (run_of(failed) / "evaluations.csv").read_bytes()
    assert rows.count(b"\n") >= 5 and (run_of(reference) / "evaluations.csv").read_bytes().startswith(rows)

    for name, words in [("full before", "the disk is full"), ("read-only", "can't be written (Read-only file system)")]:
        code, output = told[name]
        assert code in (1, 2) and words in output and "Traceback" not in output, output

    code, output = told["space again"]
    assert code == 0 and "resumed at step" in output, output
    assert_same_end(seen / "end", reference)


def _on_a_small_disk(disk: Path, seen: Path) -> None:
    try:
        own_mounts()
        mount("-t", "tmpfs", "-o", "size=4m", "none", str(disk))
    except OSError as error:
        (seen / "not allowed").write_text(str(error))
        return
    try:
        _scenario(disk, seen)
    except BaseException:
        (seen / "error").write_text(traceback.format_exc())
        sys.exit(3)


def _scenario(disk: Path, seen: Path) -> None:
    told = {}
    results = disk / "results"
    results.mkdir()
    gate = seen / "gate"
    gate.mkdir()
    pid = _begin(results, seen / "output", prepare=partial(close_gate, str(gate), 150))
    wait_for(lambda: waiting(gate, 0))
    _fill(disk / "filler")
    open_gate(gate, 0)
    told["full while training"] = _end(pid, seen / "output")
    shutil.copytree(results, seen / "full")
    told["full before"] = _end(_begin(disk / "results", seen / "output", "seed=1"), seen / "output")
    (disk / "filler").unlink()
    mount("-o", "remount,ro", str(disk))
    told["read-only"] = _end(_begin(results, seen / "output"), seen / "output")
    mount("-o", "remount,rw", str(disk))
    shutil.rmtree(results / "test" / "runs" / "td3" / "hopper" / "tiny" / "none" / "seed_1", ignore_errors=True)
    told["space again"] = _end(_begin(results, seen / "output"), seen / "output")
    shutil.copytree(results, seen / "end")
    (seen / "told.json").write_text(json.dumps(told))


def _begin(results: Path, output: Path, *more: str, prepare: Callable[[], None] | None = None) -> int:
    pid = os.fork()
    if pid == 0:
        code = 1
        try:
            run_here([*AAN, *more, f"results_dir={results}"], output, prepare)
        except SystemExit as stop:
            code = stop.code if isinstance(stop.code, int) else 1
        except BaseException:
            traceback.print_exc()
        finally:
            sys.stdout.flush()
            sys.stderr.flush()
            os._exit(code)
    return pid


def _end(pid: int, output: Path) -> tuple[int, str]:
    _, status = os.waitpid(pid, 0)
    return os.waitstatus_to_exitcode(status), output.read_text()


def _fill(path: Path) -> None:
    with path.open("wb", buffering=0) as file:
        try:
            while True:
                file.write(bytes(4096))
        except OSError:
            pass  # full, as it should be
