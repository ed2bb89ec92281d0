"""One look for all figures: Okabe and Ito's colours (safe for colour-blind readers), distinct in grey by line,
marker and hatch.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import matplotlib

matplotlib.use("Agg")

from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from analysis.data.names import ACTORS

RC: Any = {
    "font.family": "DejaVu Sans", "font.size": 8, "axes.titlesize": 9, "axes.labelsize": 8, "legend.fontsize": 8,
    "xtick.labelsize": 7, "ytick.labelsize": 7, "axes.spines.top": False, "axes.spines.right": False, "axes.grid": True,
    "grid.alpha": 0.25, "grid.linewidth": 0.5, "lines.linewidth": 1.4, "legend.frameon": False, "pdf.fonttype": 42,
    "figure.dpi": 100, "savefig.dpi": 200, "hatch.linewidth": 0.6,
    "figure.constrained_layout.use": True, "text.parse_math": False,  # a "$" in a label is a dollar
}  # fmt: skip


class Look(NamedTuple):
    """How an arm is drawn, the same in every figure."""

    color: str
    line: Any
    marker: str
    hatch: str


_PAPER = {
    "aan": Look("#000000", (0, (5, 2)), "s", ""),
    "popsan": Look("#0072B2", (0, (1, 1.2)), "^", "////"),
    "bptsan_wo_ndt": Look("#E69F00", (0, (6, 1.5, 1, 1.5)), "v", "...."),
    "bptsan_wo_li": Look("#009E73", (0, (3, 1, 1, 1, 1, 1)), "D", "xxxx"),
    "bptsan": Look("#D55E00", "solid", "o", ""),
}
_OTHERS = (
    Look("#CC79A7", (0, (4, 1)), "P", "\\\\\\\\"),
    Look("#56B4E9", (0, (2, 1)), "X", "||||"),
    Look("#999999", (0, (8, 2)), "<", "----"),
    Look("#7A5C00", (0, (1, 2)), ">", "oooo"),
    Look("#4B0092", (0, (5, 1, 1, 1)), "*", "++++"),
)


def looks(arms: list[str]) -> dict[str, Look]:
    """The look of each arm; arms beyond the paper's take the remaining looks in the order given, then again."""
    others = [arm for arm in arms if arm not in ACTORS]
    return {arm: _PAPER[arm] if arm in _PAPER else _OTHERS[others.index(arm) % len(_OTHERS)] for arm in arms}


def panels(count: int, width: float = 2.35, height: float = 2.1, columns: int = 4) -> tuple[Figure, list[Axes]]:
    """A row of ``count`` panels, at most ``columns`` wide, without empty axes; room for a legend below."""
    across = min(count, columns)
    down = -(-count // across)
    figure, axes = plt.subplots(down, across, figsize=(max(across * width, 4.2), down * height + 0.45), squeeze=False)
    flat = [axis for row in axes for axis in row]
    for axis in flat:
        axis.locator_params(nbins=5)
    for axis in flat[count:]:
        axis.remove()
    return figure, flat[:count]


def step_axis(axis: Axes, training_steps: int) -> None:
    """Steps in millions, or in thousands where a run is shorter than half a million."""
    millions = training_steps >= 500_000
    unit, word = (1e6, "million") if millions else (1e3, "thousand")
    axis.set_xlim(0, training_steps)
    axis.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value / unit:g}"))
    axis.set_xlabel(f"Environment steps ({word})")


def legend_below(figure: Figure, axes: list[Axes], columns: int = 3) -> None:
    """One legend for all panels, outside the data."""
    entries: dict[str, Any] = {}
    for axis in axes:
        for handle, label in zip(*axis.get_legend_handles_labels()):
            entries.setdefault(label, handle)
    if entries:
        widest = 0.75 + 0.068 * max(map(len, entries))  # inches: the line, and 8-point letters
        columns = max(1, min(columns, int(figure.get_figwidth() / widest)))
        figure.legend(
            entries.values(),
            entries.keys(),
            loc="outside lower center",
            ncols=min(columns, len(entries)),
            handlelength=3.2,
        )
