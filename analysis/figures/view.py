"""What a figure is drawn from."""

from __future__ import annotations

from dataclasses import dataclass

from analysis.claims_file import Claims
from analysis.data.cells import Cell, select
from analysis.data.study import Study
from analysis.style import SCREEN, Style
from analysis.verdicts import Judgement


@dataclass(frozen=True)
class View:
    """One algorithm of a study, and how it is to be drawn.

    Attributes:
        cells: of the whole study.
        by: configuration keys to facet and colour by, none to two.
    """

    study: Study
    cells: list[Cell]
    claims: Claims
    judgement: Judgement
    algo: str
    style: Style = SCREEN
    by: tuple[str, ...] = ()

    @property
    def here(self) -> list[Cell]:
        """The cells of this algorithm."""
        return select(self.cells, self.algo)
