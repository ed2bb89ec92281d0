"""A run killed at any moment and started again by the same command ends as one never killed, byte for byte."""

from __future__ import annotations

import json
import os
import random
import time
from collections import Counter
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest

from tests.end_to_end.commands import (
    AAN,
    KILL,
    TINY,
    Forked,
    assert_same_end,
    forked,
    manifest,
    newest_checkpoint,
    run_of,
    wait_for,
)
from tests.gate import close_gate, forget, waiting

CASES = {
    "td3 aan hopper": ("algo=td3", "actor=aan", "env=hopper"),
    "sac aan ant": ("algo=sac", "actor=aan", "env=ant"),
    "td3 bptsan poisson ant": ("algo=td3", "actor=bptsan", "env=ant", "encoder=poisson"),
    "sac bptsan deterministic hopper": ("algo=sac", "actor=bptsan", "env=hopper", "encoder=deterministic"),
    "sac bptsan poisson hopper": ("algo=sac", "actor=bptsan", "env=hopper", "encoder=poisson"),
}
Moment = Callable[[Path, Forked, random.Random], bool]


def state(results: Path) -> Path | None:
    found = list((results / "test" / "runs").glob("*/*/*/*/seed_*/state"))
    return found[0] if found else None


def tight(seen: Callable[[str], bool], where: Callable[[Path], Path]) -> Moment:
    """As soon as a name is seen in a folder, for the first to fourth time, asked without a pause."""

    def moment(results: Path, process: Forked, rng: random.Random) -> bool:
        if not wait_for(lambda: state(results) is not None, process):
            return False
        folder = where(state(results) or results)

        def there() -> bool:
            return any(map(seen, os.listdir(folder)))  # noqa: PTH208 - the fastest way to look

        for _ in range(rng.randrange(4)):
            if not (wait_for(there, process, poll=0) and wait_for(lambda: not there(), process, poll=0)):
                return False
        return wait_for(there, process, poll=0)

    return moment


def after_a_while(results: Path, process: Forked, rng: random.Random) -> bool:
    """At any time from the very start on: while it composes, imports, claims, or has just begun."""
    time.sleep(rng.uniform(0.0, 4.0))
    return not process.at_gate()


def in_training(results: Path, process: Forked, rng: random.Random) -> bool:
    """Some time after its next checkpoint."""
    before = newest_checkpoint(results)
    if not wait_for(lambda: newest_checkpoint(results) > before, process):
        return False
    time.sleep(rng.uniform(0.0, 0.6))
    return not process.at_gate()


def behind_rows(results: Path, process: Forked, rng: random.Random) -> bool:
    """As soon as ``evaluations.csv`` grows: its fsync or the rest of the interval's end is still to come."""
    if not wait_for(lambda: state(results) is not None, process):
        return False
    path = (state(results) or results).parent / "evaluations.csv"
    before = path.stat().st_size if path.exists() else 0
    return wait_for(lambda: path.exists() and path.stat().st_size > before, process, poll=0)


MOMENTS: dict[str, Moment] = {
    "any time": after_a_while,
    "in training": in_training,
    "while a checkpoint is written": tight(lambda name: name.startswith(".checkpoint-"), lambda folder: folder),
    "while rows are written": behind_rows,
    "while the manifest is written": tight(lambda name: name.startswith(".manifest"), lambda folder: folder.parent),
}


def kill_and_restart(
    folder: Path, command: tuple[str, ...], total: int, moments: list[str], rng: random.Random
) -> tuple[Path, Counter[str], Counter[str]]:
    """Start and kill once for each moment, then run to the end.

    However fast the machine is, no run ends before its kill: each start may go through its share of the ``total``
    steps and then waits.

    Returns:
        The results; kills by moment, those of waiting runs under "at the gate"; what they had left behind.
    """
    results, gate = folder / "results", folder / "gate"
    gate.mkdir()
    kills: Counter[str] = Counter()
    left: Counter[str] = Counter()
    for number, name in enumerate(moments, 1):
        forget(gate, 0)
        step = total * number // (len(moments) + 1)
        process = Forked(results, *command, prepare=partial(close_gate, str(gate), step))
        process.at_gate = lambda: bool(waiting(gate, 0))
        in_time = MOMENTS[name](results, process, rng)
        process.signal(KILL)
        assert process.wait() == -KILL, process.output
        kills[name if in_time else "at the gate"] += 1
        left.update(traces(results))
    code, output = forked(results, *command)
    assert code == 0, output
    return results, kills, left


def traces(results: Path) -> set[str]:
    """Which halves a kill has left."""
    folder = state(results)
    if folder is None:
        return {"nothing yet"}
    found = set()
    if list(folder.glob(".checkpoint-*")):
        found.add("half a checkpoint")
    if list(folder.parent.glob(".manifest.json.*")):
        found.add("a manifest not yet renamed")
    rows = folder.parent / "evaluations.csv"
    if rows.exists():
        last = rows.read_text().rpartition("\n")[0].rpartition("\n")[2].split(",")[0]
        if last.isdigit() and int(last) > newest_checkpoint(results):
            found.add("rows past the checkpoint")
    if (folder.parent / "manifest.json").exists():
        content = json.loads((folder.parent / "manifest.json").read_text())
        if newest_checkpoint(results) > (content["checkpoint_step"] or -1):
            found.add("a checkpoint that the manifest does not know yet")
    return found


def test_three_kills(reference: Path, tmp_path: Path) -> None:
    moments = ["in training", "while a checkpoint is written", "while rows are written"]
    results, kills, _ = kill_and_restart(tmp_path, AAN, 450, moments, random.Random(1))
    assert sum(kills.values()) == 3 and manifest(results)["times_resumed"] >= 1
    assert_same_end(results, reference)


@pytest.mark.long
@pytest.mark.parametrize("case", CASES)
def test_many_kills(case: str, undisturbed: Callable[..., Path], tmp_path: Path) -> None:
    """``-s`` prints how many kills landed where."""
    command = (*CASES[case], *TINY, "protocol.total_steps=1500")
    rng = random.Random(case)
    moments = [name for name in MOMENTS for _ in range(2)]
    rng.shuffle(moments)
    results, kills, left = kill_and_restart(tmp_path, command, 1500, moments, rng)
    print(f"\n{case}: {sum(kills.values())} kills {dict(kills)}, left behind: {dict(left)}")
    assert_same_end(results, undisturbed(*command))
    if "bptsan" in case:
        assert run_of(results).parts[-2] in case.split()
