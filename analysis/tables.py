"""A table once, in three forms: CSV with full numbers, LaTeX (booktabs), and display strings for the report."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from analysis.data.writing import write_csv, write_text

_LATEX = str.maketrans(
    {
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
        "<": r"$<$",
        ">": r"$>$",
        "±": r"$\pm$",
        "–": "--",
        "−": r"$-$",
        "×": r"$\times$",
        "≥": r"$\geq$",
        "τ": r"$\tau$",
        "“": "``",
        "”": "''",
        "…": r"\ldots{}",
        "[": "{[}",
        "]": "{]}",
    }
)
#: Leading columns that together name a row; the page sets them as one.
_NAMING = ("Algorithm", "Task", "Actor")
#: A row of this many characters in 8-point type is wider than a column of 3.35 inches.
_COLUMN_CHARACTERS = 52
#: Longer texts are set as paragraphs of this many inches.
_PARAGRAPH, _INCHES = 34, 1.7
CAPTION_WORDS = 60
#: Where a label has no run on a task.
NO_RUN = "no run"
#: A row of a paper's table that holds nothing else is left out.
_NOTHING = ("", "–", "0", NO_RUN)


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
        best: printed cells ``(row, column)`` that a paper sets in bold.
        paper: headers of the columns that a paper prints; all where empty.
        stacked: on a narrow screen each row becomes a block of lines instead of scrolling sideways.
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
    best: frozenset[tuple[int, int]] = frozenset()
    paper: tuple[str, ...] = ()
    stacked: bool = False

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
            "stacked": self.stacked,
            "naming": self.naming(),
        }

    def naming(self) -> int:
        """How many leading columns name a row."""
        headers = self.headers()
        return next((k for k, header in enumerate(headers) if header not in _NAMING), len(headers))

    def latex(self, brief: bool = False) -> str:
        r"""A ``table`` or, where a column is too narrow for it, a ``table*`` with booktabs rules.

        ``brief``, for an article: only the columns of ``paper``, without rows that say nothing and names that all rows
        share; the caption under 60 words.
        """
        frame: Any = pd.DataFrame(self.rows(), columns=range(len(self.columns)), dtype=object)
        kept = self._kept(frame) if brief else list(frame.columns)
        if brief:
            numbers = [k for k in kept if self.numeric()[k]]
            frame = frame[~frame[numbers].isin(_NOTHING).all(axis=1)].replace(NO_RUN, "–")
        frame, headers, numeric = frame[kept], self.headers(), self.numeric()
        widths = {k: max([len(headers[k]), *frame[k].map(len)]) for k in kept}
        align = {k: "r" if numeric[k] else f"p{{{_INCHES}in}}" if widths[k] > _PARAGRAPH else "l" for k in kept}
        wide = sum(min(widths[k], _PARAGRAPH) + 1.5 for k in kept) > _COLUMN_CHARACTERS
        style = frame.style.hide(axis="index").format(escape_latex)
        style = style.format_index(lambda k: escape_latex(headers[k]), axis=1)
        bold = pd.DataFrame("", index=frame.index, columns=frame.columns)
        for row, column in self.best if brief else ():
            if column in kept and row in bold.index:
                bold.loc[row, column] = "font-weight: bold"
        style = style.apply(lambda _: bold, axis=None)
        body = style.to_latex(hrules=True, column_format="".join(align.values()), convert_css=True)
        repeated = self.caption.startswith(self.title)
        caption = self.caption if repeated else f"{self.title}. {self.caption}"
        caption = short_caption(caption) if brief else caption
        kind = "table*" if wide else "table"
        lines = [
            f"\\begin{{{kind}}}",
            "\\centering",
            "\\footnotesize",
            *(["\\setlength{\\tabcolsep}{3pt}"] if brief else []),
            f"\\caption{{{escape_latex(caption)}}}",
            f"\\label{{tab:{self.name.replace('_', '-')}}}",
            body.rstrip("\n"),
            f"\\end{{{kind}}}",
        ]
        return "\n".join(lines) + "\n"

    def _kept(self, frame: pd.DataFrame) -> list[int]:
        """The columns of a paper: those asked for that print something, without names that all rows share."""
        headers = self.headers()
        asked = [k for k, header in enumerate(headers) if not self.paper or header in self.paper]
        constant = {k for k in range(self.naming()) if len(frame) and frame[k].nunique() == 1}
        empty = {k for k in asked if len(frame) and frame[k].isin(["", "–"]).all()}
        return [k for k in asked if k not in constant | empty]

    def save(self, folder: Path) -> None:
        """``<name>.csv`` and ``<name>.tex``."""
        write_csv(folder / f"{self.name}.csv", self.frame)
        write_text(folder / f"{self.name}.tex", self.latex())


def escape_latex(words: str) -> str:
    """Every character that LaTeX would read as a command, or that pdfLaTeX does not know."""
    return str(words).translate(_LATEX)


def short_caption(caption: str, words: int = CAPTION_WORDS) -> str:
    """The first whole sentences of a caption that together stay under so many words."""
    kept: list[str] = []
    for sentence in re.split(r"(?<=[.!?])\s+(?=[A-Z“])", caption.strip()):
        if kept and len(" ".join([*kept, sentence]).split()) >= words:
            break
        kept.append(sentence)
    return " ".join(kept)


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
