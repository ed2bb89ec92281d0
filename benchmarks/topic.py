"""What a topic of ``python -m benchmarks`` hands back, as a table for people and as plain containers for JSON."""

from __future__ import annotations

import sys
from dataclasses import dataclass, field
from typing import Any, Literal

from rich.console import Console
from rich.table import Table

from benchmarks.spread import Spread

Value = str | int | float | Spread | None
Row = dict[str, Value]


@dataclass
class Topic:
    """One table.

    Args:
        title: what was measured, in a few words.
        method: how, in a sentence or two; stands below the table and in the JSON.
        columns: key in the rows -> header, in the order of the table; ``quartiles`` are those of ``ratio``.
        rows: the measurements; a key that a row lacks is an empty cell.
        goal: whether ``ratio`` should be at most or at least the row's ``goal``.
        notes: what a reader must know besides.
    """

    title: str
    method: str
    columns: dict[str, str] = field(default_factory=dict)
    rows: list[Row] = field(default_factory=list)
    goal: Literal["at most", "at least"] | None = None
    notes: list[str] = field(default_factory=list)
    seconds: float = 0.0

    def reached(self, row: Row) -> bool | None:
        """Whether the median ratio of the row keeps its goal; None where it has none."""
        ratio, goal = row.get("ratio"), row.get("goal")
        if not isinstance(ratio, Spread) or not isinstance(goal, int | float):
            return None
        return ratio.median <= goal if self.goal == "at most" else ratio.median >= goal

    def table(self) -> Table:
        """For a terminal."""
        title = f"{self.title} ({self.seconds:.0f} s)" if self.seconds else self.title
        table = Table(title=title, title_justify="left")
        for key, header in self.columns.items():
            numeric = any(not isinstance(row.get(key), str | None) for row in self.rows)
            table.add_column(header, justify="right" if numeric else "left", overflow="fold")
        for row in self.rows:
            table.add_row(*(self._cell(row, key) for key in self.columns))
        return table

    def _cell(self, row: Row, key: str) -> str:
        value = row.get(key)
        if key == "quartiles":
            ratio = row.get("ratio")
            return f"{_number(ratio.low)} to {_number(ratio.high)}" if isinstance(ratio, Spread) else ""
        if key == "goal" and value is not None:
            return f"{'≤' if self.goal == 'at most' else '≥'} {value}"
        text = shown(value)
        reached = self.reached(row) if key == "ratio" else None
        return text if reached is None else f"[{'green' if reached else 'red'}]{text}[/]"

    def plain(self) -> dict[str, Any]:
        """For JSON; a spread becomes ``{median, low, high, rounds}``, and a row with a goal says ``reached``."""
        rows = []
        for row in self.rows:
            plain: dict[str, Any] = {k: v._asdict() if isinstance(v, Spread) else v for k, v in row.items()}
            if (reached := self.reached(row)) is not None:
                plain["reached"] = reached
            rows.append(plain)
        return {
            "title": self.title,
            "method": self.method,
            "goal": self.goal,
            "notes": self.notes,
            "seconds": round(self.seconds, 1),
            "rows": rows,
        }


def console() -> Console:
    """The terminal, or wide enough for the tables where there is none."""
    return Console() if sys.stdout.isatty() else Console(width=130)


def shown(value: Value) -> str:
    """A number with three digits; of a spread the median."""
    if value is None:
        return ""
    if isinstance(value, Spread):
        return _number(value.median)
    return _number(value) if isinstance(value, float) else str(value)


def _number(value: float) -> str:
    if value == 0 or abs(value) >= 100:
        return f"{value:.0f}"
    return f"{value:.2f}" if abs(value) < 10 else f"{value:.1f}"
