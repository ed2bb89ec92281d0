"""If these fail, logs are flooded, or the heartbeat that others trust stops."""

import pytest
from rich.console import Console

from src.experiment import progress
from src.experiment.ownership import acquire
from tests.experiment.runs import smoke


class Clock:
    def __init__(self):
        self.now = 0.0

    def monotonic(self):
        return self.now


@pytest.fixture
def clock(monkeypatch):
    monkeypatch.setattr(progress, "time", Clock())
    return progress.time


def test_plain_lines_come_now_and_then_and_at_the_end(clock, capsys):
    plain = progress.PlainProgress(1000)
    for step in range(50, 1050, 50):
        clock.now += 5.0
        plain.update(step, None if step < 500 else 12.34, 10.0)
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 5
    assert lines[0] == "step 50/1000  return -  10 steps/s  2 min left"
    assert lines[-1].startswith("step 1000/1000  return 12.3")


def test_the_heartbeat_is_throttled_but_never_stops(tmp_path, clock):
    with acquire(smoke(tmp_path)) as (run, _):
        run.update_manifest(wall_time_seconds=100.0)
        beat = progress.Heartbeat(run, progress.PlainProgress(1000))
        seen = []
        for step in range(50, 1050, 50):
            clock.now += 5.0
            beat.update(step, None, 10.0)
            seen.append(run.read_manifest().step)
    assert sorted(set(seen)) == [0, 150, 300, 450, 600, 750, 900]
    assert run.read_manifest().wall_time_seconds == 190.0 and beat.wall_time_seconds == 200.0


def test_durations_are_for_people():
    told = [progress.duration(seconds) for seconds in (3, 89, 300, 5369, 5400, 36000)]
    assert told == ["3 s", "89 s", "5 min", "89 min", "1 h 30 min", "10 h 00 min"]
    assert progress.time_left(100, 0.0) == "?"


def test_a_line_is_printed_as_it_is(capsys):
    text = "results/:x:/[red]seed_0[/red] failed: " + "why " * 50
    progress.say(Console(), text)
    assert capsys.readouterr().out == f"{text}\n"
