"""What a plan would cost: hours and disk. Rough, and says what it rests on."""

from __future__ import annotations

import json
import statistics
from collections.abc import Sequence
from dataclasses import asdict
from functools import cache
from pathlib import Path
from typing import NamedTuple

from src.config.schema import ENGINE, EnvConfig, ExperimentConfig
from src.experiment.machine import processor
from src.experiment.run_directory import ManifestError, RunDirectory
from src.paths import repository_path

#: Environment steps per second of one run on one core, rough, where nothing has been measured yet (TD3 on Hopper): half
#: of what docs/performance.md found on a fast machine.
DEFAULT_RATES = {
    "aan": 350.0, "popsan": 170.0, "bptsan_wo_ndt": 140.0, "bptsan_wo_li": 110.0, "bptsan": 110.0,
    "popdan": 80.0, "mdcsan": 40.0, "ilcsan": 40.0, "lif_san": 140.0,
}  # fmt: skip
_OTHER_RATE = 60.0
_PROXY_RATE = 35.0


class Cost(NamedTuple):
    """Hours of one core, hours on the clock, bytes of replay at the peak and at the end."""

    core_hours: float
    clock_hours: float
    peak_bytes: int
    kept_bytes: int
    measured: bool  # the rates of all runs come from this results folder and this kind of processor


def cost(runs: Sequence[tuple[ExperimentConfig, int]], jobs_at_once: int) -> Cost:
    """Cost of the runs to do, each with the steps that are done already."""
    hours, replays, kept, measured = [], [], 0, True
    for config, done in runs:
        rate, is_measured = _rate(config)
        measured &= is_measured
        hours.append(max(config.protocol.total_steps - done, 0) / rate / 3600)
        observation, action = _sizes(json.dumps(asdict(config.env)))
        replay = config.protocol.total_steps * (2 * observation + action + 2) * 4
        replays.append(replay)
        kept += replay if config.keep_replay else 0
    peak = kept + sum(sorted(replays, reverse=True)[:jobs_at_once])
    clock = max(sum(hours) / max(jobs_at_once, 1), max(hours, default=0.0))
    return Cost(sum(hours), clock, peak, kept, measured)


def _rate(config: ExperimentConfig) -> tuple[float, bool]:
    rates = _measured_rates(repository_path(config.results_dir)).get(
        (config.algo.name, config.actor.name, config.env.name)
    )
    if rates:
        return statistics.median(rates), True
    rate = DEFAULT_RATES.get(config.actor.name, _OTHER_RATE)
    return min(rate, _PROXY_RATE) if config.algo.name == "td3_proxy" else rate, False


@cache
def _measured_rates(results: Path) -> dict[tuple[str, str, str], list[float]]:
    """Steps per second of the runs in the results folder that this engine trained on a processor such as this one."""
    rates: dict[tuple[str, str, str], list[float]] = {}
    here = processor()
    for path in results.glob("*/runs/*/*/*/*/seed_*"):
        try:
            run = RunDirectory(path).read_manifest()
        except (ManifestError, OSError):
            continue
        if run is None or (run.engine, run.processor) != (ENGINE, here):
            continue
        if run.step >= 1000 and run.wall_time_seconds > 0:
            rates.setdefault((run.algo, run.actor, run.env), []).append(run.step / run.wall_time_seconds)
    return rates


@cache
def _sizes(task: str) -> tuple[int, int]:
    """(N, M) of an :class:`EnvConfig` in JSON; the plan has built each of them before."""
    from src.training.gym_task import sizes  # Gymnasium takes a while to import

    return sizes(EnvConfig(**json.loads(task)))
