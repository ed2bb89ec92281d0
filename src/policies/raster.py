"""The raster figure of an episode: spikes of its first decisions, firing rates over all of it, and what came of it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.ticker import MaxNLocator

from src.policies.episode import Episode, Population

WIDTH = 7.0  # inches: two columns of a paper
_STYLE: Any = {
    "font.size": 8, "axes.titlesize": 8, "axes.labelsize": 8, "xtick.labelsize": 7, "ytick.labelsize": 7,
    "axes.spines.top": False, "axes.spines.right": False, "axes.linewidth": 0.6, "pdf.fonttype": 42,
    "savefig.dpi": 300, "text.parse_math": False,
}  # fmt: skip


def draw(episode: Episode, title: str) -> Figure:
    """A row for each population, then the actions, then the reward; left the first decisions, right the episode.

    Neurons of hidden layers are sorted by their mean rate over the episode; input and output stay in their order
    (receptive fields of an observation, and neurons of an action, lie side by side).
    """
    populations = episode.populations
    with plt.rc_context(_STYLE):
        heights = [*(_height(population) for population in populations), 0.8, 0.6]
        figure, grid = plt.subplots(
            len(heights),
            2,
            figsize=(WIDTH, sum(heights) + 0.25 * len(heights) + 0.5),
            height_ratios=heights,
            sharex="col",
            squeeze=False,
            layout="constrained",
        )
        decisions = _decisions(populations)
        for row, population in enumerate(populations):
            last = row == len(populations) - 1
            output = last and population.spiking
            order = _order(population, sort=row > 0 and not output)
            name = "output" if output else population.name.replace("layer", "layer ")
            _first_decisions(grid[row, 0], population, order, name)
            _whole_episode(figure, grid[row, 1], population, order)
        for column, steps in enumerate((decisions, len(episode.rewards))):
            limit = float(np.abs(episode.actions).max()) or 1.0
            _actions(figure, grid[-2, column], episode.actions[:steps], limit, bar=column == 1)
            _reward(grid[-1, column], episode.rewards[:steps])
            grid[-1, column].set_xlabel("environment step" if column else _first_label(populations))
            grid[-1, column].set_xlim(0, steps)
            grid[-1, column].xaxis.set_major_locator(MaxNLocator(integer=True))
        grid[0, 0].set_title(f"first {decisions} decisions", loc="left")
        grid[0, 1].set_title("whole episode", loc="left")
        figure.suptitle(title, fontsize=9)
        figure.align_ylabels()
    return figure


def save(figure: Figure, folder: Path) -> list[Path]:
    """``raster.png`` and ``raster.pdf``; the same episode gives the same bytes."""
    paths = [folder / "raster.png", folder / "raster.pdf"]
    with plt.rc_context(_STYLE):
        figure.savefig(paths[0], metadata={"Software": None})
        figure.savefig(paths[1], metadata={"CreationDate": None, "Creator": None, "Producer": None})
    plt.close(figure)
    return paths


def _height(population: Population) -> float:
    """Inches: more for more neurons, but never much."""
    return float(np.clip(population.rates.shape[1] / 200, 0.7, 1.25))


def _decisions(populations: Sequence[Population]) -> int:
    return len(populations[0].first) // populations[0].time_steps if populations else 20


def _first_label(populations: Sequence[Population]) -> str:
    steps = max((population.time_steps for population in populations), default=1)
    return f"decision ({steps} time steps each)" if steps > 1 else "decision"


def _order(population: Population, sort: bool) -> np.ndarray:
    neurons = population.rates.shape[1]
    return np.argsort(population.rates.mean(0), kind="stable") if sort else np.arange(neurons)


def _first_decisions(axes: Axes, population: Population, order: np.ndarray, name: str) -> None:
    """Every time step: a mark for each spike; real activations as an image."""
    shown = population.first[:, order]
    decisions = len(shown) // population.time_steps
    neurons = shown.shape[1]
    if not population.spiking:
        _image(axes, shown, population.rates)
    else:
        for decision in range(1, decisions):
            axes.axvline(decision, color="0.88", linewidth=0.4, zorder=0)
        time, neuron = np.nonzero(shown)
        few = neurons < 60
        axes.scatter(
            (time + 0.5) / population.time_steps,
            neuron + 0.5,
            s=12.0 if few else 1.0,
            marker="|" if few else ".",
            linewidths=0.6 if few else 0.0,
            color="black",
            rasterized=True,
        )
    axes.set_ylabel(f"{name}\n{neurons} {'neurons' if population.spiking else 'units'}")
    axes.set_ylim(0, neurons)
    axes.yaxis.set_major_locator(MaxNLocator(3, integer=True))


def _whole_episode(figure: Figure, axes: Axes, population: Population, order: np.ndarray) -> None:
    """The firing rate of each neuron at each decision; of real activations their value."""
    shown = population.rates[:, order]
    image = _image(axes, shown, None if population.spiking else shown)
    _bar(figure, axes, image, "firing rate" if population.spiking else "activation")


def _image(axes: Axes, shown: np.ndarray, scale: np.ndarray | None) -> AxesImage:
    """``[time, n]``, time to the right. Colours from 0 to 1, or as far as 99.5 % of the values of ``scale`` reach."""
    limit = 1.0 if scale is None else float(np.quantile(np.abs(scale), 0.995)) or 1.0
    signed = scale is not None and bool((scale < 0).any())
    axes.set_yticks([])
    return axes.imshow(
        shown.T,
        extent=(0, len(shown), 0, shown.shape[1]),
        aspect="auto",
        origin="lower",
        interpolation="nearest",
        cmap="RdBu_r" if signed else "viridis",
        vmin=-limit if signed else 0.0,
        vmax=limit,
        rasterized=True,
    )


def _bar(figure: Figure, axes: Axes, image: AxesImage, label: str) -> None:
    bar = figure.colorbar(image, ax=axes, pad=0.01, fraction=0.04)
    bar.set_label(label, fontsize=7)
    bar.outline.set_linewidth(0.4)  # type: ignore[operator]


def _actions(figure: Figure, axes: Axes, actions: np.ndarray, limit: float, bar: bool) -> None:
    """One row for each dimension, the first at the bottom."""
    image = _image(axes, actions, np.array([-limit, limit]))
    if bar:
        _bar(figure, axes, image, "action")
    else:
        axes.set_ylabel(f"action\n{actions.shape[1]} dimensions")


def _reward(axes: Axes, rewards: np.ndarray) -> None:
    axes.stairs(rewards, np.arange(len(rewards) + 1), baseline=None, color="black", linewidth=0.8)
    axes.set_ylabel("reward")
