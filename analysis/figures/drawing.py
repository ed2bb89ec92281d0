"""What a figure is: a drawing with the data that it draws, or the reason why there is none."""

from __future__ import annotations

import io
import json
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd
from matplotlib import pyplot as plt
from matplotlib.figure import Figure

from analysis.data.writing import write_bytes, write_csv, write_text

#: Nothing in these depends on the clock or on this program's version.
_METADATA: dict[str, dict[str, Any]] = {
    "pdf": {"CreationDate": None, "Producer": None, "Creator": None},
    "png": {"Software": None},
}


@dataclass
class Drawing:
    """A figure of the report; ``missing`` says why it could not be drawn, and then there is no ``figure``.

    Attributes:
        alt: what the figure shows, for those who do not see it: the content, not the kind of figure.
        folded: shown behind a click.
        curves: what the page's script redraws with values under the pointer (learning curves only).
    """

    name: str
    title: str
    caption: str
    section: str = "figures"
    figure: Figure | None = None
    data: pd.DataFrame | None = None
    missing: str = ""
    alt: str = ""
    folded: bool = False
    curves: dict[str, Any] | None = None
    algo: str = ""

    def __post_init__(self) -> None:
        # it becomes a file name, and may hold a key from a manifest
        self.name = re.sub(r"[^A-Za-z0-9_.=-]", "_", self.name)

    def save(self, folder: Path, alone: bool = False) -> None:
        """``<name>.pdf``, ``.png`` and ``.csv``, the CSV of exactly what is drawn; then close the figure.

        ``alone``: the PDF only.
        """
        if self.figure is None or self.data is None:
            return
        if not alone:
            write_csv(folder / f"{self.name}.csv", self.data)
        if self.curves is not None and not alone:
            write_text(folder / f"{self.name}.json", json.dumps(self.curves, separators=(",", ":"), allow_nan=False))
        if self.figure.get_layout_engine() is not None:
            self.figure.draw_without_rendering()  # lay out once, not once per format
            self.figure.set_layout_engine("none")
        # savefig puts back the layout engine that the settings name, and would lay out again
        with plt.rc_context({"figure.constrained_layout.use": False}):
            for kind in ("pdf",) if alone else ("pdf", "png"):
                buffer = io.BytesIO()
                self.figure.savefig(buffer, format=kind, metadata=_METADATA[kind])
                write_bytes(folder / f"{self.name}.{kind}", buffer.getvalue())
        plt.close(self.figure)

    def as_dict(self) -> dict[str, Any]:
        """For ``figures.json``."""
        return {
            "name": self.name,
            "title": self.title,
            "caption": self.caption,
            "section": self.section,
            "drawn": self.figure is not None,
            "missing": self.missing,
            "alt": self.alt,
            "folded": self.folded,
            "curves": self.curves is not None,
            "algo": self.algo,
        }
