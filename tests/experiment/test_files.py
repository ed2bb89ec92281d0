"""If these fail, a kill or a full disk leaves numbers in the logs that were never measured."""

import os
import signal
import subprocess
import sys
import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from src.experiment.files import CsvLog, EvaluationLog, last_return, last_row
from tests.experiment.runs import ROOT

finite = st.floats(allow_nan=False, allow_infinity=False, allow_subnormal=False)  # training flushes them to 0


@given(st.lists(st.tuples(finite, st.integers(1, 1000)), min_size=1, max_size=5))
def test_returns_come_back_bit_for_bit(tmp_path_factory, episodes):
    path = tmp_path_factory.mktemp("log") / "evaluations.csv"
    EvaluationLog(path).append(0, episodes)
    header, *rows = path.read_text().splitlines()
    assert header == "step,episode,return,length"
    assert [(float(row.split(",")[2]), int(row.split(",")[3])) for row in rows] == episodes


@given(st.integers(0, 200))
def test_a_torn_row_is_cut_on_open_and_whole_rows_stay(tmp_path_factory, cut):
    path = tmp_path_factory.mktemp("log") / "evaluations.csv"
    log = EvaluationLog(path)
    for step in (0, 500, 1000):
        log.append(step, [(213.75, 1000), (-1.5, 3)])
    whole = path.read_bytes()
    path.write_bytes(whole[: min(cut, len(whole))])
    EvaluationLog(path)
    assert whole.startswith(path.read_bytes())
    assert path.read_bytes() in (b"", *(whole[: i + 1] for i, byte in enumerate(whole) if byte == 10))
    EvaluationLog(path).append(1500, [(1.0, 1)])
    assert path.read_text().startswith("step,episode,return,length\n")
    assert path.read_text().endswith("\n1500,0,1.0,1\n")


@given(st.integers(-1, 2500))
def test_cut_after_drops_exactly_the_later_rows(tmp_path_factory, step):
    path = tmp_path_factory.mktemp("log") / "evaluations.csv"
    log = EvaluationLog(path)
    for each in (0, 500, 1000, 2000):
        log.append(each, [(1.0, 5), (2.0, 6)])
    log.cut_after(step)
    steps = [int(line.split(",")[0]) for line in path.read_text().splitlines()[1:]]
    assert steps == [each for each in (0, 500, 1000, 2000) for _ in range(2) if each <= step]


def test_cut_after_without_a_file_is_nothing(tmp_path):
    EvaluationLog(tmp_path / "evaluations.csv").cut_after(0)
    assert list(tmp_path.iterdir()) == []


def test_a_short_write_is_taken_back(tmp_path, monkeypatch):
    log = EvaluationLog(tmp_path / "evaluations.csv")
    log.append(0, [(1.0, 5)])
    before = log.path.read_bytes()
    real = os.write
    monkeypatch.setattr(os, "write", lambda descriptor, content: real(descriptor, content[:7]))
    with pytest.raises(OSError, match="No space left"):
        log.append(500, [(1.0, 5)])
    assert log.path.read_bytes() == before


def test_one_write_per_evaluation(tmp_path, monkeypatch):
    """All rows of an evaluation in one os.write: a kill between two writes would leave half an evaluation."""
    writes = []
    real = os.write
    monkeypatch.setattr(os, "write", lambda descriptor, content: writes.append(content) or real(descriptor, content))
    EvaluationLog(tmp_path / "evaluations.csv").append(0, [(1.0, 5)] * 10)
    assert len(writes) == 1 and writes[0].count(b"\n") == 11


def test_training_rows_keep_the_first_rows_columns(tmp_path):
    path = tmp_path / "training.csv"
    CsvLog(path).write({"step": 500, "critic_loss": None, "q1": 0.1})
    log = CsvLog(path)
    log.write({"q1": 0.25, "step": 1000})
    assert path.read_text() == "step,critic_loss,q1\n500,,0.1\n1000,,0.25\n"
    with pytest.raises(ValueError, match="no column q2"):
        log.write({"step": 1500, "q2": 1.0})
    with pytest.raises(ValueError, match="must be step"):
        CsvLog(tmp_path / "other.csv").write({"q1": 1.0})


def test_readers_ignore_what_is_torn(tmp_path):
    path = tmp_path / "evaluations.csv"
    assert last_return(path) is None and last_row(path) is None
    path.write_text("step,episode,return,length\n")
    assert last_return(path) is None and last_row(path) is None
    path.write_text("step,episode,return,length\n0,0,5.0,9\n500,0,10.0,9\n500,1,20.0,9\n1000,0,9")
    assert last_return(path) == 15.0
    assert last_row(path) == {"step": "500", "episode": "1", "return": "20.0", "length": "9"}


WRITER = """
import sys
from pathlib import Path
from src.experiment.files import EvaluationLog
log = EvaluationLog(Path(sys.argv[1]))
for step in range(10**6):
    log.append(step, [(step / 7, 1000), (step / 3, 999)])
"""


def test_no_kill_leaves_a_row_that_was_not_written(tmp_path):
    for attempt in range(5):
        path = tmp_path / f"{attempt}.csv"
        writer = subprocess.Popen([sys.executable, "-c", WRITER, str(path)], cwd=ROOT)
        while not path.exists() and writer.poll() is None:
            time.sleep(0.01)
        time.sleep(0.03 * attempt)
        writer.send_signal(signal.SIGKILL)
        writer.wait()
        EvaluationLog(path)
        rows = [line.split(",") for line in path.read_text().splitlines()[1:]]
        for number, (step, episode, total, length) in enumerate(rows):
            assert (int(step), int(episode)) == divmod(number, 2)
            assert (float(total), int(length)) == (((int(step) / 7), 1000), ((int(step) / 3), 999))[int(episode)]
