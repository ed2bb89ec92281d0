"""Real grids under the local launcher: a raising and a killed cell, two launchers at once, a finished grid again."""

from __future__ import annotations

import json
import os
import re
import resource
import subprocess
from pathlib import Path
from typing import Any

import pytest

from tests.end_to_end.commands import AAN, KILL, TINY, newest_checkpoint, real, wait_for
from tests.gate import environment, open_gate, waiting

GRID = [each for each in TINY if not each.startswith(("actor.hidden", "label"))]
CONF = Path(__file__).parent / "conf"


def finish(process: subprocess.Popen[str], timeout: float = 300) -> tuple[int, str]:
    try:
        output, _ = process.communicate(timeout=timeout)
    finally:
        process.kill()
    return process.returncode, output


def runs(results: Path) -> dict[int, Path]:
    found = (results / "test" / "runs").glob("*/*/*/*/seed_*")
    return {int(each.name.removeprefix("seed_")): each for each in found}


def manifests(results: Path) -> dict[int, dict[str, Any]]:
    return {seed: json.loads((path / "manifest.json").read_text()) for seed, path in runs(results).items()}


def test_a_raising_and_a_killed_cell_take_no_other_with_them(tmp_path: Path) -> None:
    gate = tmp_path / "gate"
    gate.mkdir()
    flag = tmp_path / "flag"
    broken = flag.with_name("flag.1")
    broken.touch()
    grid = ("-m", "actor=raising", f"actor.arguments.flag={flag}", "seed=0,1,2", "hydra.launcher.n_jobs=2")
    command = (*grid, f"hydra.searchpath=[file://{CONF}]", "label=mine", *GRID)
    sweep = real(tmp_path, *command, environment=environment(gate, 100))
    open_gate(gate, 0, 1)
    wait_for(lambda: waiting(gate, 2) or sweep.poll() is not None)
    assert sweep.poll() is None, finish(sweep, 10)
    os.kill(waiting(gate, 2)[2], KILL)
    code, output = finish(sweep)
    assert code == 1, output
    table = output[output.index("finished:") :]
    assert "1 complete" in table and "2 failed" in table
    assert re.search(r"failed +td3/hopper/mine/none/seed_1 +ZeroDivisionError: a bug in the user's actor", table), table
    assert re.search(r"failed +td3/hopper/mine/none/seed_2 +killed by SIGKILL", table), table
    before = manifests(tmp_path)
    assert [before[seed]["status"] for seed in range(3)] == ["complete", "failed", "failed"]
    assert "ZeroDivisionError" in (runs(tmp_path)[1] / "failure.txt").read_text()

    broken.unlink()
    code, output = finish(real(tmp_path, *command))
    assert code == 0 and "2 to do, 1 done" in output, output
    after = manifests(tmp_path)
    assert [after[seed]["status"] for seed in range(3)] == ["complete"] * 3
    assert after[0] == before[0], "the complete cell was touched"
    assert [after[seed]["times_resumed"] for seed in range(3)] == [0, 1, 1]
    assert not (runs(tmp_path)[1] / "failure.txt").exists()


@pytest.mark.long  # with a pretending trainer: tests/experiment/test_interrupt.py
def test_two_launchers_at_once_run_no_cell_twice(tmp_path: Path) -> None:
    command = ("-m", "actor=aan", "seed=0,1,2", "label=two", *GRID, "hydra.launcher.n_jobs=1")
    gate = tmp_path / "gate"
    gate.mkdir()
    both = [real(tmp_path, *command, environment=environment(gate, 50)) for _ in range(2)]
    wait_for(lambda: len(waiting(gate, 0, 1)) == 2)
    open_gate(gate, 0, 1, 2)
    ends = [finish(each) for each in both]
    assert all(code in (0, 75) for code, _ in ends), ends
    ended = manifests(tmp_path)
    assert [ended[seed]["status"] for seed in range(3)] == ["complete"] * 3
    assert [ended[seed]["times_resumed"] for seed in range(3)] == [0] * 3
    for seed, run in runs(tmp_path).items():
        begun = (run / "state" / "log.txt").read_text().count("step 50/450")
        assert begun == 1, f"seed {seed} was begun {begun} times"


def test_sixty_complete_cells_are_skipped_in_no_time(reference: Path, tmp_path: Path) -> None:
    """Made by hand from one complete cell. Sixty may take the processor five times as long as one."""
    from src.experiment.run_directory import RunDirectory
    from tests.experiment.runs import changed, run_of

    arguments = (*AAN[1:], "actor=aan")
    first = run_of(*arguments, f"results_dir={tmp_path}")
    for seed in range(60):
        run = changed(first, seed=seed)
        directory = RunDirectory(run.path)
        directory.state.mkdir(parents=True)
        (source,) = (reference / "test" / "runs").glob("*/*/*/*/seed_0")
        content = json.loads((source / "manifest.json").read_text())
        content |= {"seed": seed, "configuration_hash": run.configuration_hash}
        (directory.path / "manifest.json").write_text(json.dumps(content))
        directory.write_config(run)
    seconds = {}
    for cells in (1, 60):
        before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
        code, output = finish(real(tmp_path, "-m", *arguments, f"seed=range({cells})"))
        seconds[cells] = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before
        assert code == 0 and f"0 to do, {cells} done" in output, output
    print(f"processor time of 1 and of 60 complete cells: {seconds[1]:.2f} and {seconds[60]:.2f} s")
    assert seconds[60] < 5 * seconds[1]
    assert newest_checkpoint(tmp_path) == -1


def test_a_complete_run_is_extended_where_its_replay_was_kept(tmp_path: Path) -> None:
    from tests.end_to_end.commands import assert_same_end, forked

    longer = "protocol.total_steps=600"
    assert forked(tmp_path / "whole", *AAN, longer)[0] == 0
    assert forked(tmp_path / "extended", *AAN, "keep_replay=true")[0] == 0
    code, output = forked(tmp_path / "extended", *AAN, longer)
    assert code == 0 and "resumed at step 450" in output, output
    assert_same_end(tmp_path / "extended", tmp_path / "whole")
    code, output = forked(tmp_path / "whole", *AAN, "protocol.total_steps=750")
    assert code == 2 and "Traceback" not in output, output
    assert "complete at 600 steps and can't be extended to 750" in output and "keep_replay=true" in output
    assert_same_end(tmp_path / "whole", tmp_path / "extended")
