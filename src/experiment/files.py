"""Files that a kill can't tear: replaced as a whole, or appended to by one ``os.write`` and an fsync.

Buffered writes tore a row in 4 of 12 kills, and pandas read the torn row without a word. So: whatever follows the last
newline is cut when a writer opens a log, and a short write (a full disk) is taken back before it is reported.
"""

from __future__ import annotations

import errno
import os
import tempfile
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path


def replace_file(path: Path, content: bytes) -> None:
    """Write beside, fsync, rename, fsync the folder: a reader sees the old bytes or the new ones, never a mix.

    Raises:
        OSError: a full disk or a folder that can't be written; the old file is then untouched.
    """
    descriptor, beside = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        with os.fdopen(descriptor, "wb") as file:
            file.write(content)
            file.flush()
            os.fchmod(file.fileno(), 0o644)
            os.fsync(file.fileno())
        Path(beside).replace(path)
    except BaseException:
        Path(beside).unlink(missing_ok=True)
        raise
    folder = os.open(path.parent, os.O_RDONLY)
    try:
        os.fsync(folder)  # makes the rename survive a power cut
    finally:
        os.close(folder)


class CsvLog:
    """An append-only CSV whose first column is the step. Made by the one process that holds the run's lock."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._cut_torn_row()

    def cut_after(self, step: int) -> None:
        """Drop the rows with a larger step than ``step``; the file is replaced as a whole."""
        if not self.path.exists():
            return
        header, *rows = self.path.read_bytes().splitlines(keepends=True) or [b""]
        kept = [row for row in rows if int(row.split(b",", 1)[0]) <= step]
        if len(kept) < len(rows):
            replace_file(self.path, header + b"".join(kept))

    def steps(self, last: int) -> list[int]:
        """The first column of the rows up to step ``last``, in the order of the file.

        Raises:
            ValueError: a row that doesn't begin with a number.
        """
        if not self.path.exists():
            return []
        found = [int(row.split(b",", 1)[0]) for row in self.path.read_bytes().splitlines()[1:]]
        return [step for step in found if step <= last]

    def write(self, *rows: Mapping[str, float | int | None]) -> None:
        """Append ``rows`` in one write, with a header before them where the file is new.

        The first row fixes the columns; None, or a column that a row lacks, is an empty field.

        Raises:
            OSError: nothing was appended.
            ValueError: ``step`` is not the first column, or a row has a column that the file lacks.
        """
        header = self._header()
        columns = header or list(rows[0])
        if columns[0] != "step":
            raise ValueError(f"the first column of {self.path.name} must be step, not {columns[0]}")
        if unknown := {key for row in rows for key in row} - set(columns):
            raise ValueError(f"{self.path.name} has no column {', '.join(sorted(unknown))}")
        lines = [] if header else [",".join(columns)]
        lines += [",".join(_field(row.get(column)) for column in columns) for row in rows]
        self._append(("\n".join(lines) + "\n").encode())

    def _header(self) -> list[str] | None:
        try:
            with self.path.open() as file:
                line = file.readline()
        except FileNotFoundError:
            return None
        return line.rstrip("\n").split(",") if line else None

    def _append(self, content: bytes) -> None:
        descriptor = os.open(self.path, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o644)
        try:
            before = os.fstat(descriptor).st_size
            written = os.write(descriptor, content)
            if written < len(content):
                os.ftruncate(descriptor, before)
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(self.path))
            os.fsync(descriptor)
        finally:
            os.close(descriptor)

    def _cut_torn_row(self) -> None:
        try:
            content = self.path.read_bytes()
        except FileNotFoundError:
            return
        if content and not content.endswith(b"\n"):
            os.truncate(self.path, content.rfind(b"\n") + 1)


class EvaluationLog(CsvLog):
    """``evaluations.csv``: one row per evaluation episode."""

    def append(self, step: int, episodes: Sequence[tuple[float, int]]) -> None:
        """Append the ``(return, length)`` of every episode of one evaluation, all or none."""
        self.write(
            *(
                {"step": step, "episode": index, "return": float(total), "length": int(length)}
                for index, (total, length) in enumerate(episodes)
            )
        )


def last_row(path: Path) -> dict[str, str] | None:
    """The last whole row, for readers that run beside the writer; None where there is none yet."""
    try:
        lines = path.read_text().split("\n")[:-1]  # what follows the last newline is torn
    except FileNotFoundError:
        return None
    return dict(zip(lines[0].split(","), lines[-1].split(","))) if len(lines) > 1 else None


def last_speed(path: Path) -> float:
    """Steps per second of the last interval in a ``training.csv``; 0 where there is none."""
    row = last_row(path)
    return float(row.get("steps_per_second") or 0) if row else 0.0


def last_return(path: Path) -> float | None:
    """Mean return of the last evaluation in an ``evaluations.csv``; None where there is none."""
    means = mean_returns(path)
    return means[max(means)] if means else None


def mean_returns(path: Path) -> dict[int, float]:
    """Mean return of each evaluation in an ``evaluations.csv``, by its step; empty where there is none."""
    episodes: dict[int, list[float]] = {}
    with suppress(FileNotFoundError):
        for line in path.read_text().split("\n")[1:-1]:
            step, _, episode_return = line.split(",")[:3]
            episodes.setdefault(int(step), []).append(float(episode_return))
    return {step: sum(returns) / len(returns) for step, returns in episodes.items()}


def _field(value: object) -> str:
    if value is None:
        return ""
    return repr(float(value)) if isinstance(value, float) else str(value)
