"""SIGTERM and SIGINT on real runs: exit 75, the manifest says so, the same command goes on to the same end."""

from __future__ import annotations

import shutil
import signal
import time
from pathlib import Path

from tests.end_to_end.commands import (
    AAN,
    Forked,
    assert_same_end,
    forked,
    manifest,
    newest_checkpoint,
    run_of,
    wait_for,
)


def test_sigterm(interrupted: Path, reference: Path, tmp_path: Path) -> None:
    results = shutil.copytree(interrupted, tmp_path / "copy")
    stopped = manifest(results)
    assert stopped["status"] == "interrupted"
    assert stopped["step"] == stopped["checkpoint_step"] == newest_checkpoint(results) < 450
    code, output = forked(results, *AAN)
    assert code == 0 and f"resumed at step {stopped['step']}" in output, output
    assert manifest(results)["times_resumed"] == 1
    assert_same_end(results, reference)


def test_one_sigint_takes_a_checkpoint(reference: Path, tmp_path: Path) -> None:
    """The checkpoint interval is the whole run, so only the signal can have made one."""
    command = (*AAN, "protocol.checkpoint_interval=450")
    process = Forked(tmp_path, *command)
    wait_for(lambda: "step 50/450" in process.output, process)
    process.signal(signal.SIGINT)
    assert process.wait() == 75, process.output
    assert manifest(tmp_path)["status"] == "interrupted" and newest_checkpoint(tmp_path) > 0
    code, output = forked(tmp_path, *command)
    assert code == 0 and "resumed at step" in output, output
    assert_same_end(tmp_path, reference)


def test_a_second_sigint_stops_at_once(tmp_path: Path) -> None:
    """The first evaluation takes seconds: after the first signal the run goes on with it."""
    process = Forked(tmp_path, *AAN, "protocol.evaluation_episodes=1000")
    wait_for(lambda: 'observation_size": 11' in _manifest_text(tmp_path), process)
    process.signal(signal.SIGINT)
    time.sleep(0.5)
    assert process.alive, process.output
    process.signal(signal.SIGINT)
    assert process.wait(30) == 130, process.output
    assert manifest(tmp_path)["status"] == "interrupted"
    assert newest_checkpoint(tmp_path) == -1 and not (run_of(tmp_path) / "evaluations.csv").exists()


def _manifest_text(results: Path) -> str:
    found = list((results / "test" / "runs").glob("*/*/*/*/seed_*/manifest.json"))
    return found[0].read_text() if found else ""
