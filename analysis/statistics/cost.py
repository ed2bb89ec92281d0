"""Firing and saturation at the end of training, and throughput."""

from __future__ import annotations

import numpy as np
import pandas as pd

from analysis.data.names import actor_name, algorithm_name, in_order, task_name
from analysis.data.outcome import Outcome
from analysis.data.study import Study
from analysis.health import MEASURES, final_health
from analysis.tables import Column, Table, number, text

_WHERE: list[Column] = [("algorithm", "Algorithm", text), ("task", "Task", text), ("actor", "Actor", text)]


def _named(algo: str, env: str, arm: str) -> dict[str, object]:
    return {
        "algo": algo,
        "env": env,
        "arm": arm,
        "algorithm": algorithm_name(algo),
        "task": task_name(env),
        "actor": actor_name(arm),
    }


def health_table(study: Study) -> Table:
    """Firing and saturation per layer in the last 10% of training."""
    frame = final_health(study)
    frame = frame.assign(
        algorithm=frame["algo"].map(algorithm_name),
        task=frame["env"].map(task_name),
        actor=frame["arm"].map(actor_name),
    )
    columns: list[Column] = [
        *_WHERE,
        ("layer", "Layer", number()),
        ("n", "n", number()),
        *((measure, name[0].upper() + name[1:], number(3)) for measure, name in MEASURES.items()),
    ]
    caption = (
        "Means over the last 10% of the steps and the seeds that count and came so far; the last layer is the output "
        "population. Window "
        "share: (neuron, step) "
        "pairs whose membrane lies where the surrogate gradient is not zero. Near 0, a layer no longer learns."
    )
    return Table(
        "spiking_health",
        "health",
        "Spiking health at the end of training",
        caption,
        frame,
        columns,
        "No finished spiking run.",
        True,
    )


def throughput_table(study: Study) -> Table:
    """Steps per second and hours per run, by processor: machines are not comparable."""
    rows = []
    for algo, env, arm in in_order(zip(study.runs["algo"], study.runs["env"], study.runs["arm"])):
        runs = study.runs[(study.runs["algo"] == algo) & (study.runs["env"] == env) & (study.runs["arm"] == arm)]
        for processor, group in runs.groupby(runs["processor"].fillna("unknown"), sort=True):
            done = group[group["counts_as"] == Outcome.FINISHED]
            training = study.training.merge(group[["algo", "env", "arm", "seed"]], on=["algo", "env", "arm", "seed"])
            speed = (
                training["steps_per_second"].median() if "steps_per_second" in training and len(training) else np.nan
            )
            hours = done["wall_time_seconds"].astype(float).mean() / 3600 if len(done) else np.nan
            threads = ", ".join(str(int(t)) for t in sorted(group["threads"].dropna().unique()))
            devices = ", ".join(sorted(group["device"].dropna().unique()))
            rows.append(
                {
                    **_named(algo, env, arm),
                    "processor": processor,
                    "threads": threads,
                    "device": devices,
                    "n": len(group),
                    "steps_per_second": speed,
                    "hours": hours,
                }
            )
    columns: list[Column] = [
        *_WHERE,
        ("processor", "Processor", text),
        ("device", "Device", text),
        ("threads", "Threads", str),
        ("n", "Runs", number()),
        ("steps_per_second", "Steps per second (median)", number(1)),
        ("hours", "Hours per finished run", number(2)),
    ]
    caption = (
        "Environment steps per second of an evaluation interval, evaluation included, median over intervals and runs."
    )
    frame = pd.DataFrame(
        rows, columns=[*_named("", "", ""), "processor", "threads", "device", "n", "steps_per_second", "hours"]
    )
    return Table("throughput", "health", "Training throughput", caption, frame, columns, folded=True)
