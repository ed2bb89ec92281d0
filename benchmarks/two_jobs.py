"""Two jobs of the local launcher against one, and against what two processes reach on this machine without it.

Two cores of a virtual machine are often two hyperthreads of one: then even bare matrix products don't double, and the
launcher's own loss is the ratio of ratios.
"""

from __future__ import annotations

import csv
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any, NamedTuple

from benchmarks.floor import Floor, products_of_a_burst
from benchmarks.our_loop import ours
from benchmarks.race import Race
from benchmarks.relay import Racer, Turns
from benchmarks.spread import Spread
from benchmarks.topic import Row, Topic
from benchmarks.update import SIZES
from src.config.schema import ExperimentConfig
from src.paths import ROOT

GOAL = 1.85


class Extent(NamedTuple):
    """How much is measured."""

    race: Race  # of the loops without the launcher
    bursts: int  # of products in a turn
    interval: int  # steps between two rows of training.csv
    intervals: int
    launches: int


FULL = Extent(Race(500, 250, 2, 50), bursts=5, interval=250, intervals=5, launches=2)
QUICK = Extent(Race(100, 50, 1, 10), bursts=1, interval=50, intervals=4, launches=1)


def topic(quick: bool = False) -> Topic:
    """Products, loops, launcher."""
    extent = QUICK if quick else FULL
    result = Topic(
        title="two jobs at once",
        method=(
            "BPT-SAN, TD3, Hopper, one thread each. Products: matrix products of an update, bursts per second. Loops: "
            "two training loops in two processes, environment steps per second. Launcher: python -m src.run -m with "
            "one seed and n_jobs=1, with two seeds and n_jobs=2; the rate of a job is steps_per_second of its "
            "training.csv without the first and the last row (start-up doesn't count; seconds_* in the JSON are of "
            "whole commands). Ratio: the sum of the two rates over the rate alone, in turns."
        ),
        columns={
            "what": "what",
            "one": "one alone",
            "two": "two at once, sum",
            "ratio": "ratio",
            "quartiles": "quartiles",
            "goal": "goal",
            "of_loops": "of two loops' ratio",
            "of_products": "of two products' ratio",
        },
        goal="at least",
    )
    with tempfile.TemporaryDirectory(prefix="benchmark-") as name:
        folder = Path(name)
        config = extent.race.configuration(folder / "0", algo="td3", actor="bptsan", env="hopper")
        products = _both("bare products", bare_products, [{"config": config}] * 2, 1, extent.bursts, extent.race.rounds)
        arguments = [
            {
                "config": extent.race.configuration(folder / str(k), algo="td3", actor="bptsan", env="hopper"),
                "evaluation_env": extent.race.evaluation_env(config.env),
            }
            for k in range(2)
        ]
        race = extent.race
        loops = _both("training loops", ours, arguments, race.warm_up, race.window, race.rounds)
        launcher = _launcher(folder, extent)
    launcher["of_loops"] = _median(launcher) / _median(loops)
    launcher["of_products"] = _median(launcher) / _median(products)
    result.rows = [products, loops, launcher]
    result.notes.append("'of two loops' ratio' is what the launcher itself keeps: 1 where it costs nothing")
    return result


def bare_products(turns: Turns, config: ExperimentConfig) -> None:
    """A runner: a step is the products of one burst."""
    products = Floor(products_of_a_burst(config, *SIZES["hopper"]))
    library = products.best_library()
    burst = 0
    while turns.reached(burst):
        products.run(library)
        burst += 1


def _median(row: Row) -> float:
    ratio = row["ratio"]
    assert isinstance(ratio, Spread)
    return ratio.median


def _both(
    what: str, runner: Callable[..., None], arguments: list[dict[str, Any]], warm_up: int, window: int, rounds: int
) -> Row:
    """Each alone, then both at once, so many rounds."""
    alone, together = [], []
    with ExitStack() as stack:
        racers = [stack.enter_context(Racer(runner, **each)) for each in arguments]
        for racer in racers:
            racer.run(warm_up)
        step = warm_up
        for _ in range(rounds):
            step += window
            alone.append(statistics.fmean(_rate(racer.run(step)) for racer in racers))
            step += window
            for racer in racers:
                racer.begin(step)
            together.append(sum(_rate(racer.result()) for racer in racers))
    return _row(what, alone, together)


def _rate(window: Any) -> float:
    return float(window.steps / window.seconds)


def _row(what: str, alone: list[float], together: list[float]) -> Row:
    ratios = [t / a for a, t in zip(alone, together, strict=True)]
    return {"what": what, "one": Spread.of(alone), "two": Spread.of(together), "ratio": Spread.of(ratios)}


def _launcher(folder: Path, extent: Extent) -> Row:
    alone, together, seconds_one, seconds_two = [], [], [], []
    for index in range(extent.launches):
        (rate,), seconds = _launch(folder / f"one{index}", 1, extent)
        alone.append(rate)
        seconds_one.append(seconds)
        rates, seconds = _launch(folder / f"two{index}", 2, extent)
        together.append(sum(rates))
        seconds_two.append(seconds)
    row = _row("launcher", alone, together) | {"goal": GOAL}
    return row | {"seconds_one": Spread.of(seconds_one), "seconds_two": Spread.of(seconds_two)}


def _launch(results: Path, jobs: int, extent: Extent) -> tuple[list[float], float]:
    """Steps per second of each job, and seconds of the whole command."""
    command = [sys.executable, "-m", "src.run", "-m", "actor=bptsan", "env=hopper", "algo=td3", "protocol=short"]
    command += [f"seed=range({jobs})", f"hydra.launcher.n_jobs={jobs}", "study=benchmark", f"results_dir={results}"]
    for key, value in {
        "total_steps": extent.interval * extent.intervals,
        "start_steps": extent.interval,
        "update_after": extent.interval,
        "evaluation_interval": extent.interval,
        "evaluation_episodes": 1,
        "checkpoint_interval": extent.interval * extent.intervals,
    }.items():
        command.append(f"protocol.{key}={value}")
    started = time.perf_counter()
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    seconds = time.perf_counter() - started
    if done.returncode:
        raise RuntimeError(f"the launcher failed: {(done.stdout + done.stderr)[-1000:]}")
    logs = sorted(results.rglob("training.csv"))
    assert len(logs) == jobs
    return [statistics.fmean(_rates(log)[1:-1]) for log in logs], seconds


def _rates(log: Path) -> list[float]:
    with log.open() as file:
        return [float(row["steps_per_second"]) for row in csv.DictReader(file)]
