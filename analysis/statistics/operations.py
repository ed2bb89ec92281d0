"""The table of counted operations: both sides' counts, ratios to the AAN, energy and where the order turns."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from analysis.data.names import actor_name, algorithm_name, in_order, task_name
from analysis.data.operations import COLUMNS
from analysis.data.study import Study
from analysis.energy import PRICES, UPDATE_OPERATIONS, turning_ratio
from analysis.tables import Column, Table, number, text

NOT_MEASURED = (
    "Energy: not measured. No run of this study has an operations.json, the operations of its trained policy counted "
    "over evaluation episodes; without it the sparsity of a ReLU network and of a spiking one cannot be weighed alike."
)


#: By algorithm, task and arm, the mean over runs of each column.
_Means = dict[tuple[str, str, str], dict[str, float]]


def operations_table(study: Study) -> Table:
    """One row per algorithm, task and actor whose runs have been counted; ratios are to the AAN of the task."""
    frame = _frame(study)
    columns: list[Column] = [
        ("algorithm", "Algorithm", text),
        ("task", "Task", text),
        ("actor", "Actor", text),
        ("n", "n", number()),
        ("mac_effective", "MACs", number()),
        ("mac_dense", "dense", number()),
        ("ac_effective", "ACs", number()),
        ("ac_dense", "dense", number()),
        ("neuron_updates", "Neuron updates", number()),
        ("encoder_exponentials", "Exponentials", number()),
        ("random_numbers", "Random numbers", number()),
        ("activation_sparsity", "Activation sparsity", number(2)),
        ("connection_sparsity", "Connection sparsity", number(2)),
        ("kilobytes", "Footprint (kB)", number()),
        ("ratio", "Ops / AAN", number(2)),
        ("ratio_updates", "with updates", number(2)),
        *((f"nanojoule_{price.name}", f"nJ, {price.mac:g}/{price.ac:g} pJ", number(1)) for price in PRICES),
        ("turns", "Order turns at MAC/AC", text),
    ]
    caption = (
        "One decision of the trained policy, mean over evaluation episodes and seeds (n). MACs and ACs: synaptic "
        "operations with a non-zero input and weight, beside the dense count; a layer whose inputs are all −1, 0 or 1 "
        "counts ACs. Ops / AAN: MACs and ACs together against the AAN's; with updates: each neuron update priced at "
        f"{UPDATE_OPERATIONS} operations. Energy: synaptic operations at two published prices ({PRICES[0].source}; "
        f"{PRICES[1].source}); last column: what a MAC must cost in ACs for the order of actor and AAN to turn. "
        "Exponentials of the encoder and random numbers are listed, not priced; memory traffic is not counted."
    )
    joules = tuple(header for key, header, _ in columns if key.startswith("nanojoule"))
    paper = ("Algorithm", "Task", "Actor", "MACs", "ACs", "Neuron updates", "Ops / AAN", "with updates", *joules)
    title = "Operations and energy of one decision"
    return Table("operations", "health", title, caption, frame, columns, NOT_MEASURED, paper=paper)


def _frame(study: Study) -> pd.DataFrame:
    grouped = study.operations.groupby(["algo", "env", "arm"])
    means: _Means = grouped[COLUMNS].mean().to_dict("index") if len(study.operations) else {}  # type: ignore[assignment]
    counts = grouped.size()
    rows = [_row(*cell, means, int(counts[cell])) for cell in in_order(means)]
    names = ["algo", "env", "arm", "algorithm", "task", "actor", "n", *COLUMNS, "connection_sparsity", "kilobytes"]
    names += ["ratio", "ratio_updates", *(f"nanojoule_{price.name}" for price in PRICES), "turning_ratio", "turns"]
    return pd.DataFrame(rows, columns=names)


def _row(algo: str, env: str, arm: str, means: _Means, n: int) -> dict[str, Any]:
    mine = means[algo, env, arm]
    row: dict[str, Any] = {
        "algo": algo,
        "env": env,
        "arm": arm,
        "algorithm": algorithm_name(algo),
        "task": task_name(env),
        "actor": actor_name(arm),
        "n": n,
        **mine,
        "connection_sparsity": mine["zero_weights"] / mine["weights"] if mine["weights"] else np.nan,
        "kilobytes": mine["footprint_bytes"] / 1000,
    }
    for price in PRICES:
        row[f"nanojoule_{price.name}"] = price.nanojoule(mine["mac_effective"], mine["ac_effective"])
    if (algo, env, "aan") not in means:
        return row | {"turns": "no AAN counted"}
    aan = means[algo, env, "aan"]
    synaptic, of_aan = (side["mac_effective"] + side["ac_effective"] for side in (mine, aan))
    updates, aan_updates = (UPDATE_OPERATIONS * side["neuron_updates"] for side in (mine, aan))
    ratio = turning_ratio(mine["mac_effective"], mine["ac_effective"], aan["mac_effective"], aan["ac_effective"])
    return row | {
        "ratio": synaptic / of_aan,
        "ratio_updates": (synaptic + updates) / (of_aan + aan_updates),
        "turning_ratio": ratio,
        "turns": _turns(mine, aan, ratio) if arm != "aan" else "–",
    }


def _turns(mine: dict[str, float], aan: dict[str, float], ratio: float) -> str:
    """Above which cost ratio of a MAC to an AC the actor with fewer MACs is the cheaper one."""
    if np.isnan(ratio):
        cheaper = mine["mac_effective"] + mine["ac_effective"] < aan["mac_effective"] + aan["ac_effective"]
        return "never: cheaper at any" if cheaper else "never: dearer at any"
    return f"{ratio:.1f}: {'cheaper' if mine['mac_effective'] < aan['mac_effective'] else 'dearer'} above"
