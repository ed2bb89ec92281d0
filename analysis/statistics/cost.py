"""Cost and health: operations, energy, parameters; firing and saturation at the end of training; throughput."""

from __future__ import annotations

import numpy as np
import pandas as pd

from analysis.data.names import actor_name, algorithm_name, ordered_algorithms, ordered_arms, ordered_tasks, task_name
from analysis.data.study import Study
from analysis.energy import ASSUMPTIONS, Cost, cost_of
from analysis.health import MEASURES, final_health, late
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


def _cells(study: Study) -> list[tuple[str, str, str]]:
    present = set(zip(study.runs["algo"], study.runs["env"], study.runs["arm"]))
    names = [ordered_algorithms(study.runs["algo"]), ordered_tasks(study.runs["env"]), ordered_arms(study.runs["arm"])]
    return [(a, e, r) for a in names[0] for e in names[1] for r in names[2] if (a, e, r) in present]


def costs(study: Study) -> dict[tuple[str, str, str], Cost | None]:
    """The cost of one decision in each cell; None where it is not known."""
    rates = late(study)
    found: dict[tuple[str, str, str], Cost | None] = {}
    for algo, env, arm in _cells(study):
        runs = study.runs[(study.runs["algo"] == algo) & (study.runs["env"] == env) & (study.runs["arm"] == arm)]
        config, sizes = study.configurations[f"{algo}/{env}/{arm}"], runs[["observation_size", "action_size"]].iloc[0]
        if sizes.isna().any():
            found[algo, env, arm] = None
            continue
        mine = rates[(rates["algo"] == algo) & (rates["env"] == env) & (rates["arm"] == arm)]
        hidden = len(config["actor"].get("hidden_sizes") or [])
        names = ["input_firing_rate", *(f"layer{k}_firing_rate" for k in range(1, hidden + 2))]
        measured = [float(mine[name].mean()) if name in mine and len(mine) else np.nan for name in names]
        found[algo, env, arm] = cost_of(config, int(sizes.iloc[0]), int(sizes.iloc[1]), measured)
    return found


def energy_table(study: Study) -> Table:
    """Operations and energy per decision, against the artificial network of the same task where there is one."""
    found, rows = costs(study), []
    for (algo, env, arm), cost in found.items():
        runs = study.runs[(study.runs["algo"] == algo) & (study.runs["env"] == env) & (study.runs["arm"] == arm)]
        mlp = found.get((algo, env, "aan"))
        row = {**_named(algo, env, arm), "parameters": runs["actor_parameters"].iloc[0]}
        if cost is not None:
            row |= cost._asdict() | {
                "nanojoule": cost.nanojoule,
                "of_aan": cost.nanojoule / mlp.nanojoule if mlp else np.nan,
            }
        rows.append(row)
    columns: list[Column] = [
        *_WHERE,
        ("parameters", "Parameters", number()),
        ("connections", "Connections", number()),
        ("lateral_connections", "Lateral", number()),
        ("synaptic_operations", "Synaptic operations", number()),
        ("lateral_operations", "Lateral operations", number()),
        ("encoder_accumulates", "Encoder ACs", number()),
        ("bias_accumulates", "Bias ACs", number()),
        ("macs", "MACs", number()),
        ("nanojoule", "Energy (nJ)", number(1)),
        ("of_aan", "Energy / AAN", number(2)),
    ]
    caption = (
        "Per decision of the trained policy. "
        + " ".join(ASSUMPTIONS)
        + " Connections and parameters of a dendritic layer count its "
        "unmasked synapses once. “–”: not known (no finished run with firing rates, or an actor of your own)."
    )
    frame = pd.DataFrame(rows, columns=[*_named("", "", ""), "parameters", *Cost._fields, "nanojoule", "of_aan"])
    return Table("energy", "health", "Operations and energy of one decision", caption, frame, columns)


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
    for algo, env, arm in _cells(study):
        runs = study.runs[(study.runs["algo"] == algo) & (study.runs["env"] == env) & (study.runs["arm"] == arm)]
        for processor, group in runs.groupby(runs["processor"].fillna("unknown"), sort=True):
            done = group[group["counts_as"] == "finished"]
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
