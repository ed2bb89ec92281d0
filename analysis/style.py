"""How figures look: Okabe and Ito's colours (safe for colour-blind readers), distinct in grey by line, marker and
hatch; and how large they are, on a screen or in the columns of a paper.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import matplotlib

matplotlib.use("Agg")

from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from analysis.data.errors import InputError
from analysis.data.names import ACTORS

_RC: Any = {
    "font.family": "DejaVu Sans", "font.size": 8, "axes.titlesize": 9, "axes.labelsize": 8, "legend.fontsize": 8,
    "xtick.labelsize": 7, "ytick.labelsize": 7, "axes.spines.top": False, "axes.spines.right": False, "axes.grid": True,
    "grid.alpha": 0.25, "grid.linewidth": 0.5, "lines.linewidth": 1.4, "legend.frameon": False, "pdf.fonttype": 42,
    "figure.dpi": 100, "savefig.dpi": 200, "hatch.linewidth": 0.6,
    "figure.constrained_layout.use": True, "text.parse_math": False,  # a "$" in a label is a dollar
}  # fmt: skip
_PAPER_RC: Any = {
    "axes.titlesize": 8, "xtick.labelsize": 8, "ytick.labelsize": 8, "lines.linewidth": 1.1, "axes.linewidth": 0.6,
    "savefig.dpi": 300,
}  # fmt: skip
FONTS = {"sans": "DejaVu Sans", "serif": "STIXGeneral"}


@dataclass(frozen=True)
class Style:
    """Widths in inches. ``paper``: a figure is exactly one or two columns wide, so that 8-point type stays 8 points."""

    name: str
    narrow: float
    wide: float
    least_panel: float
    rc: Any

    def width(self, wanted: float) -> float:
        """The width of a figure whose panels would like ``wanted`` inches."""
        if self.name == "screen":
            return min(max(wanted, self.narrow), self.wide)
        return self.narrow if wanted <= 5.2 else self.wide


SCREEN = Style("screen", 4.2, 9.6, 1.8, _RC)


def style_named(name: str, font: str = "sans") -> Style:
    """``screen`` or ``paper``; ``font``: ``sans`` or ``serif``.

    Raises:
        InputError: there is no such style or font.
    """
    if font not in FONTS:
        raise InputError(f"There is no font {font!r}; choose {' or '.join(FONTS)}.")
    if name == "screen":
        return Style(**{**vars(SCREEN), "rc": _RC | {"font.family": FONTS[font]}})
    if name == "paper":
        return Style("paper", 3.35, 7.0, 1.5, _RC | _PAPER_RC | {"font.family": FONTS[font]})
    raise InputError(f"There is no style {name!r}; choose screen or paper.")


class ArmStyle(NamedTuple):
    """How an arm is drawn, the same in every figure."""

    color: str
    line: Any
    marker: str
    hatch: str


_PAPER = {
    "aan": ArmStyle("#000000", (0, (5, 2)), "s", ""),
    "popsan": ArmStyle("#0072B2", (0, (1, 1.2)), "^", "////"),
    "bptsan_wo_ndt": ArmStyle("#E69F00", (0, (6, 1.5, 1, 1.5)), "v", "...."),
    "bptsan_wo_li": ArmStyle("#009E73", (0, (3, 1, 1, 1, 1, 1)), "D", "xxxx"),
    "bptsan": ArmStyle("#D55E00", "solid", "o", ""),
}
_OTHERS = (
    ArmStyle("#CC79A7", (0, (4, 1)), "P", "\\\\\\\\"),
    ArmStyle("#56B4E9", (0, (2, 1)), "X", "||||"),
    ArmStyle("#999999", (0, (8, 2)), "<", "----"),
    ArmStyle("#7A5C00", (0, (1, 2)), ">", "oooo"),
    ArmStyle("#4B0092", (0, (5, 1, 1, 1)), "*", "++++"),
)


def arm_styles(arms: list[str]) -> dict[str, ArmStyle]:
    """The style of each arm. Those beyond the paper's take the remaining colours in the order given; when the colours
    come again, it is with another line, marker and hatch.
    """
    others = [arm for arm in arms if arm not in ACTORS]
    return {arm: _PAPER[arm] if arm in _PAPER else _other(others.index(arm)) for arm in arms}


def _other(index: int) -> ArmStyle:
    repeats, position = divmod(index, len(_OTHERS))
    return ArmStyle(_OTHERS[position].color, *_OTHERS[(position + repeats) % len(_OTHERS)][1:])


def svg_dashes(line: Any) -> str:
    """A line style as SVG's ``stroke-dasharray``."""
    return "none" if line == "solid" else " ".join(f"{2 * length:g}" for length in line[1])


def panels(
    style: Style, count: int, width: float = 2.35, height: float = 2.1, columns: int = 4
) -> tuple[Figure, list[Axes]]:
    """Rows of ``count`` panels, at most ``columns`` across, without empty axes; room for a legend below."""
    across = min(count, columns)
    total = style.width(across * width)
    across = max(1, min(across, int(total / style.least_panel)))
    down = -(-count // across)
    figure, axes = plt.subplots(down, across, figsize=(total, down * height + 0.45), squeeze=False)
    flat = [axis for row in axes for axis in row]
    for axis in flat:
        axis.locator_params(nbins=5 if total / across > 2 else 4)
    for axis in flat[count:]:
        axis.remove()
    return figure, flat[:count]


def panel_grid(style: Style, rows: int, columns: int, height: float = 2.1) -> tuple[Figure, list[Axes]]:
    """``rows`` x ``columns`` panels, row by row; columns share their horizontal axis."""
    total = style.width(columns * 2.35)
    shape = (total, rows * height + 0.6)
    figure, axes = plt.subplots(rows, columns, figsize=shape, squeeze=False, sharex="col", sharey="col")
    flat = [axis for row in axes for axis in row]
    for axis in flat:
        axis.locator_params(nbins=5 if total / columns > 2 else 4)
    return figure, flat


def leftmost(axes: list[Axes]) -> list[Axes]:
    """The panels that begin a row, which carry the name of the vertical axis."""
    return [axis for axis in axes if axis.get_subplotspec().is_first_col()]  # type: ignore[union-attr]


def lowest(axes: list[Axes]) -> list[Axes]:
    """The panels with none below them, which carry the name of the horizontal axis."""
    last: dict[int, Axes] = {}
    for axis in axes:
        last[axis.get_subplotspec().colspan.start] = axis  # type: ignore[union-attr]
    return list(last.values())


def step_axis(axis: Axes, training_steps: int, named: bool = True) -> None:
    """Steps in millions, or in thousands where a run is shorter than half a million."""
    millions = training_steps >= 500_000
    unit, word = (1e6, "million") if millions else (1e3, "thousand")
    axis.set_xlim(0, training_steps)
    axis.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value / unit:g}"))
    if named:
        narrow = axis.figure.get_figwidth() / axis.get_gridspec().ncols < 2  # type: ignore[union-attr]
        axis.set_xlabel(f"Steps ({word})" if narrow else f"Environment steps ({word})")


def legend_below(figure: Figure, axes: list[Axes], columns: int = 3) -> None:
    """One legend for all panels, outside the data."""
    entries: dict[str, Any] = {}
    for axis in axes:
        for handle, label in zip(*axis.get_legend_handles_labels()):
            entries.setdefault(label, handle)
    if entries:
        widest = 0.75 + 0.068 * max(map(len, entries))  # inches: the line, and 8-point letters
        columns = max(1, min(columns, int(figure.get_figwidth() / widest)))
        figure.set_figheight(figure.get_figheight() + 0.15 * (-(-len(entries) // columns) - 2))
        figure.legend(
            entries.values(),
            entries.keys(),
            loc="outside lower center",
            ncols=min(columns, len(entries)),
            handlelength=3.2,
        )
