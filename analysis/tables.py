"""A table once, in three forms: CSV with full numbers, LaTeX (booktabs), and display strings for the report."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from analysis.data.writing import write_csv, write_text

_LATEX = {
    "\\": r"\textbackslash{}",
    "&": r"\&",
    "%": r"\%",
    "$": r"\$",
    "#": r"\#",
    "_": r"\_",
    "{": r"\{",
    "}": r"\}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "<": r"\textless{}",
    ">": r"\textgreater{}",
    "±": r"$\pm$",
    "–": "--",
    "−": "$-$",
    "×": r"$\times$",
    "[": "{[}",
    "]": "{]}",
}


#: Key of the frame, header, how to print a value.
Column = tuple[str, str, Callable[[Any], str]]


@dataclass
class Table:
    """A table of the report.

    Attributes:
        section: where in the report it stands.
        frame: the full numbers.
        columns: ``(key of the frame, header, how to print a value)``; keys left out stand in the CSV only.
        empty: what to say where there are no rows.
        folded: shown behind a click, for long tables.
        display: the rows that are printed, where they are fewer than those of the CSV.
        instead: a sentence that is printed in place of the rows; the CSV keeps them.
    """

    name: str
    section: str
    title: str
    caption: str
    frame: pd.DataFrame
    columns: Sequence[Column]
    empty: str = "Nothing to show."
    folded: bool = False
    display: pd.DataFrame | None = None
    instead: str = ""

    def headers(self) -> list[str]:
        """Printed headers."""
        return [header for _, header, _ in self.columns]

    def rows(self) -> list[list[str]]:
        """Printed cells."""
        frame = self.frame if self.display is None else self.display
        if frame.empty or self.instead:
            return []
        columns = [[show(value) for value in frame[key]] for key, _, show in self.columns]
        return [list(row) for row in zip(*columns)]

    def numeric(self) -> list[bool]:
        """Which columns are numbers, and so stand on the right."""
        return [show is not text for _, _, show in self.columns]

    def as_dict(self) -> dict[str, Any]:
        """For ``tables.json``."""
        return {
            "name": self.name,
            "section": self.section,
            "title": self.title,
            "caption": self.caption,
            "headers": self.headers(),
            "numeric": self.numeric(),
            "rows": self.rows(),
            "empty": self.instead or self.empty,
            "folded": self.folded,
        }

    def latex(self) -> str:
        r"""A ``table`` environment with booktabs rules; needs ``\usepackage{booktabs}``."""
        align = "".join("r" if number else "l" for number in self.numeric())
        lines = [
            "\\begin{table}",
            "\\centering",
            f"\\caption{{{escape_latex(self.title + '. ' + self.caption)}}}",
            f"\\label{{tab:{self.name.replace('_', '-')}}}",
            f"\\begin{{tabular}}{{{align}}}",
            "\\toprule",
            " & ".join(map(escape_latex, self.headers())) + r" \\",
            "\\midrule",
            *(" & ".join(map(escape_latex, row)) + r" \\" for row in self.rows()),
            "\\bottomrule",
            "\\end{tabular}",
            "\\end{table}",
        ]
        return "\n".join(lines) + "\n"

    def save(self, folder: Path) -> None:
        """``<name>.csv`` and ``<name>.tex``."""
        write_csv(folder / f"{self.name}.csv", self.frame)
        write_text(folder / f"{self.name}.tex", self.latex())


def escape_latex(words: str) -> str:
    """Every character that LaTeX would read as a command."""
    return "".join(_LATEX.get(character, character) for character in words)


def text(value: Any) -> str:
    """As it is; nothing for a missing value."""
    return "" if value is None or (isinstance(value, float) and math.isnan(value)) else str(value)


def number(digits: int = 0, missing: str = "–") -> Callable[[Any], str]:
    """A fixed number of decimals, thousands separated, a true minus sign."""

    def show(value: Any) -> str:
        if value is None or pd.isna(value):
            return missing
        shown = f"{float(value):,.{digits}f}"
        return shown.replace("-", "−") if float(shown.replace(",", "")) != 0 else shown.lstrip("-")

    return show


def p_value(value: Any, alpha: float = 0.05) -> str:
    """Three decimals; nothing smaller than ``< 0.001``; more where a rounded p would read as ``alpha`` and is not."""
    if value is None or pd.isna(value):
        return "–"
    digits = 3
    while float(f"{value:.{digits}f}") == alpha and value != alpha and digits < 12:
        digits += 1
    return "< 0.001" if value < 0.001 and digits == 3 else f"{value:.{digits}f}"


def pair(value: Any, low: Any, high: Any, digits: int = 0) -> str:
    """``value [low, high]``, or the value alone where there is no interval."""
    show = number(digits)
    return show(value) if pd.isna(low) else f"{show(value)} [{show(low)}, {show(high)}]"


def spread(mean: Any, std: Any, n: int, digits: int = 0) -> str:
    """``mean ± std (n)``; no spread for one seed."""
    show = number(digits)
    if pd.isna(mean):
        return "–"
    return f"{show(mean)} (n={n})" if pd.isna(std) else f"{show(mean)} ± {show(std)} (n={n})"
