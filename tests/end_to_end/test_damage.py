"""Damaged or deleted state: what can be mended is, in sight; what can't is refused with what to do."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from tests.end_to_end.commands import AAN, assert_same_end, forked, manifest, run_of


@pytest.fixture
def results(interrupted: Path, tmp_path: Path) -> Path:
    return shutil.copytree(interrupted, tmp_path / "copy")


def checkpoints(results: Path) -> list[Path]:
    found = sorted((run_of(results) / "state").glob("checkpoint-*.pt"))
    assert len(found) == 2
    return found


def cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-1000])


def flip(path: Path) -> None:
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)


@pytest.mark.parametrize("damage", [cut, flip])
def test_a_damaged_newest_checkpoint_is_passed_over(results: Path, reference: Path, damage) -> None:
    before, newest = checkpoints(results)
    damage(newest)
    code, output = forked(results, *AAN)
    assert code == 0, output
    log = (run_of(results) / "state" / "log.txt").read_text()
    for told in (output, log):
        assert f"passed over {newest.name}" in told
        assert f"resumed at step {int(before.stem[-6:])}" in told
    assert_same_end(results, reference)


def test_two_damaged_checkpoints_are_refused_and_replace_starts_over(results: Path, reference: Path) -> None:
    rows = (run_of(results) / "evaluations.csv").read_bytes()
    for each in checkpoints(results):
        cut(each)
    for _ in range(2):  # the same command again says the same
        code, output = forked(results, *AAN)
        assert code == 1 and "Traceback" not in output, output
        assert "no whole checkpoint is left" in output and "on_conflict=replace" in output
        assert manifest(results)["failure"]["kind"] == "CorruptState"
        assert (run_of(results) / "failure.txt").read_text().startswith("Traceback")
        assert (run_of(results) / "evaluations.csv").read_bytes() == rows
    code, output = forked(results, *AAN, "on_conflict=replace")
    assert code == 0, output
    assert_same_end(results, reference)


@pytest.mark.parametrize(
    ("pattern", "sentence"),
    [
        ("state/replay.bin", "the file was cut short or deleted"),
        ("state/checkpoint-*.pt", "is gone"),
        ("evaluations.csv", "evaluations.csv was changed or deleted"),
        ("training.csv", "training.csv was changed or deleted"),
    ],
)
def test_a_deleted_file_is_named_and_nothing_starts_over_in_silence(results: Path, pattern: str, sentence: str) -> None:
    for each in run_of(results).glob(pattern):
        each.unlink()
    kept = {path.name: path.read_bytes() for path in run_of(results).glob("*.csv")}
    code, output = forked(results, *AAN)
    assert code == 1 and "Traceback" not in output, output
    assert sentence in output and "on_conflict=replace" in output
    assert manifest(results)["status"] == "failed" and sentence in manifest(results)["failure"]["message"]
    assert {path.name: path.read_bytes() for path in run_of(results).glob("*.csv")} == kept
