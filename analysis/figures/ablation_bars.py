"""The paper's figures ablation-td3 and ablation-sac: max average return of BPT-SAN and its two ablations."""

from __future__ import annotations

import numpy as np
import pandas as pd

from analysis import metrics
from analysis.claims_file import Claims
from analysis.data.cells import Cell, select
from analysis.data.names import actor_name, algorithm_name, task_name
from analysis.data.study import Study
from analysis.figures.drawing import Drawing
from analysis.style import looks, panels

ARMS = ("bptsan_wo_ndt", "bptsan", "bptsan_wo_li")  # the paper's order


def draw(study: Study, cells: list[Cell], algo: str, claims: Claims) -> list[Drawing]:
    """``ablation-<algo>``; its CSV has both readings, the bars are ``max_of_mean``."""
    name, title = f"ablation-{algo}", f"Ablation, {algorithm_name(algo)}: max average return"
    caption = (
        "Bars: max_of_mean, the largest value of the seeds' mean curve; whiskers: the standard deviation over seeds "
        "at that step (ddof=1, "
        "none for a single seed); dots: the seeds at that step. Nothing is smoothed. The other reading, mean_of_max, "
        "stands in the CSV and "
        "in the table “Max average return”. Finished runs, and diverged ones with their last value carried forward."
    )
    here = [cell for cell in select(cells, algo) if cell.arm in ARMS and cell.n]
    if not here:
        return [Drawing(name, title, caption, missing=f"No finished run of {', '.join(map(actor_name, ARMS))}.")]
    tasks, style = list(dict.fromkeys(cell.env for cell in here)), looks(list(ARMS))
    figure, axes = panels(len(tasks), height=2.3)
    rows = []
    for axis, env in zip(axes, tasks):
        for place, arm in enumerate(ARMS):
            found = select(here, env=env, arm=arm)
            if not found:
                axis.annotate(
                    "missing",
                    (place, 0),
                    xytext=(0, 3),
                    textcoords="offset points",
                    ha="center",
                    va="bottom",
                    rotation=90,
                    fontsize=7,
                    color="#555555",
                )
                continue
            cell, look = found[0], style[arm]
            best, each = metrics.max_of_mean(cell.steps, cell.returns), metrics.mean_of_max(cell.returns)
            axis.bar(
                place,
                best.value,
                width=0.66,
                color=look.color,
                alpha=0.45,
                edgecolor="black",
                linewidth=0.8,
                hatch=look.hatch,
            )
            if not np.isnan(best.std):
                axis.errorbar(place, best.value, yerr=best.std, color="black", capsize=3, linewidth=1)
            points = cell.returns[:, cell.steps == best.step].ravel()
            offsets = np.linspace(-0.18, 0.18, len(points)) if len(points) > 1 else np.zeros(len(points))
            axis.scatter(place + offsets, points, s=9, color="white", edgecolor="black", linewidth=0.6, zorder=3)
            rows.append(
                {
                    "env": env,
                    "arm": arm,
                    "n": cell.n,
                    "max_of_mean": best.value,
                    "max_of_mean_std": best.std,
                    "step": best.step,
                    "mean_of_max": each.value,
                    "mean_of_max_std": each.std,
                    "seeds": " ".join(map(repr, points.tolist())),
                }
            )
        counts = [str(found[0].n) if (found := select(here, env=env, arm=arm)) else "0" for arm in ARMS]
        axis.set_xticks(
            range(len(ARMS)),
            [f"{actor_name(arm).replace(' w/o', chr(10) + 'w/o')}\nn={n}" for arm, n in zip(ARMS, counts)],
        )
        axis.set_xlim(-0.6, len(ARMS) - 0.4)
        axis.grid(False, axis="x")
        axis.set_title(task_name(env))
    for axis in axes[:: min(len(axes), 4)]:
        axis.set_ylabel("Max average return\n(max_of_mean)")
    return [Drawing(name, title, caption, figure=figure, data=pd.DataFrame(rows))]
