"""Spiking health over training: a figure per task, a row per measure, a column per layer."""

from __future__ import annotations

import pandas as pd
from matplotlib import pyplot as plt

from analysis.data.names import actor_name, algorithm_name, ordered_arms, ordered_tasks, task_name
from analysis.figures.drawing import Drawing
from analysis.figures.view import View
from analysis.health import MEASURES, over_training
from analysis.style import arm_styles, step_axis

_SHORT = {
    "firing_rate": "Firing rate",
    "window_share": "Window share",
    "always_on": "Always on",
    "never_on": "Never on",
}


def draw(view: View) -> list[Drawing]:
    """``health-<algo>-<task>``; one that says so where no spiking actor has run."""
    table = over_training(view.study, view.algo)
    table = table[table["layer"] > 0]
    if table.empty:
        title = f"Spiking health, {algorithm_name(view.algo)}"
        missing = "No run of a spiking actor has been logged."
        return [Drawing(f"health-{view.algo}", title, "", "health", missing=missing, folded=True)]
    return [_drawing(view, env, table[table["env"] == env]) for env in ordered_tasks(table["env"])]


def _drawing(view: View, env: str, table: pd.DataFrame) -> Drawing:
    layers, arms = sorted(table["layer"].unique()), ordered_arms(table["arm"])
    styles = arm_styles(arms)
    runs = view.study.runs[(view.study.runs["algo"] == view.algo) & (view.study.runs["env"] == env)]
    training_steps = int(runs["training_steps"].max())
    width, height, below = (
        view.style.width(2.2 * len(layers) + 0.5),
        1.1 * len(MEASURES) + 1.1,
        0.55 + 0.18 * -(-len(arms) // 3),
    )
    shape = len(MEASURES), len(layers)
    with plt.rc_context({"figure.constrained_layout.use": False}):
        figure, axes = plt.subplots(*shape, figsize=(width, height), squeeze=False, sharex=True, sharey="row")
    # placed by hand: automatic layout of so many axes takes longer than drawing them
    figure.subplots_adjust(
        left=0.6 / width,
        right=1 - 0.15 / width,
        top=1 - 0.3 / height,
        bottom=(below + 0.1) / height,
        wspace=0.12,
        hspace=0.2,
    )
    for row, measure in enumerate(MEASURES):
        for column, layer in enumerate(layers):
            axis = axes[row][column]
            for arm in arms:
                line = table[
                    (table["arm"] == arm) & (table["layer"] == layer) & (table["measure"] == measure)
                ].sort_values("step")
                axis.plot(
                    line["step"],
                    line["value"],
                    color=styles[arm].color,
                    linestyle=styles[arm].line,
                    label=actor_name(arm),
                )
            axis.set_ylim(-0.04, 1.04)
            axis.set_yticks([0, 0.5, 1])
            axis.locator_params(axis="x", nbins=5)
            if row == 0:
                axis.set_title(
                    f"Layer {layer}" + (" (output population)" if layer == layers[-1] and len(layers) > 1 else "")
                )
            step_axis(axis, training_steps)
            if row < len(MEASURES) - 1:
                axis.set_xlabel("")
        axes[row][0].set_ylabel(_SHORT[measure])
    handles, labels = axes[0][0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="lower center", ncols=min(3, len(arms)), handlelength=3.2, borderaxespad=0.2)
    caption = (
        "Means over runs of training batches. Window share: (neuron, step) pairs whose membrane lies where the "
        "surrogate gradient is not zero; always on, never on: neurons that fire at every, or no, step for every sample "
        "of a batch. A window share near 0 with many neurons always on is saturation, the way in which spiking actors "
        "fail. Unfinished runs included."
    )
    title = f"Spiking health, {algorithm_name(view.algo)}, {task_name(env)}"
    last = table[table["step"] == table["step"].max()]
    alt = f"At step {int(table['step'].max()):,}, " + "; ".join(
        f"{actor_name(arm)}: "
        + ", ".join(f"layer {layer} fires {rate:.2f}" for layer, rate in zip(own["layer"], own["value"]))
        for arm, own in last[last["measure"] == "firing_rate"].groupby("arm", sort=True)
    )
    data = table.reset_index(drop=True)
    return Drawing(f"health-{view.algo}-{env}", title, caption, "health", figure, data, alt=f"{alt}.", folded=True)
