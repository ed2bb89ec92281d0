"""TensorBoard's events after real kills: one series, each point once. If these fail, who watches a run is misled."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

from tests.end_to_end.commands import KILL, TINY, Forked, forked, manifest, newest_checkpoint, run_of, wait_for
from tests.gate import close_gate, waiting

DEFAULT_LOGGER = [each for each in TINY if not each.startswith("logger=")]
COMMAND = (
    "actor=aan",
    *DEFAULT_LOGGER,
    "protocol.total_steps=500",
    "protocol.evaluation_interval=100",
    "protocol.checkpoint_interval=200",
)


def kill_at(step: int, results: Path, gate: Path) -> None:
    gate.mkdir()
    process = Forked(results, *COMMAND, prepare=partial(close_gate, str(gate), step))
    assert wait_for(lambda: waiting(gate, 0), process), process.output
    process.signal(KILL)
    assert process.wait() == -KILL


def curves(results: Path) -> dict[str, list[int]]:
    """The steps of every scalar, as TensorBoard reads them."""
    accumulator = EventAccumulator(str(run_of(results) / "state" / "tensorboard"))
    accumulator.Reload()
    return {tag: [event.step for event in accumulator.Scalars(tag)] for tag in accumulator.Tags()["scalars"]}


def test_a_run_that_was_killed_has_each_point_once(tmp_path: Path) -> None:
    results = tmp_path / "results"
    kill_at(150, results, tmp_path / "first")
    assert newest_checkpoint(results) == -1 and curves(results)["evaluation_return"] == [0, 100]
    kill_at(350, results, tmp_path / "second")  # begun anew: no checkpoint was there
    assert newest_checkpoint(results) == 200 and curves(results)["evaluation_return"] == [0, 100, 200, 300]
    code, output = forked(results, *COMMAND)
    assert code == 0 and "resumed at step 200" in output, output
    assert manifest(results)["status"] == "complete"
    found = curves(results)
    assert found["evaluation_return"] == [0, 100, 200, 300, 400, 500]
    assert found["critic_updates"] == [100, 200, 300, 400, 500]
    assert "step" not in found
