"""Which Slurm job was submitted for which run: a log beside submitit's files, so that a second command finds them."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path

from src.experiment.plan import Cell

_FILE = "jobs.jsonl"


def remember(folder: Path, jobs: Mapping[str, Cell]) -> None:
    """Append one line per job, all of them in one write."""
    lines = [json.dumps({"job": job, "run": _run(folder, cell)}) + "\n" for job, cell in jobs.items()]
    handle = os.open(folder / _FILE, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o666)
    try:
        os.write(handle, "".join(lines).encode())
    finally:
        os.close(handle)


def last_jobs(folder: Path, cells: Sequence[Cell]) -> list[str | None]:
    """For each cell the job that was submitted last, if ever one was."""
    jobs: dict[str, str] = {}
    path = folder / _FILE
    for line in path.read_text().splitlines() if path.exists() else ():
        try:
            entry = json.loads(line)
            jobs[entry["run"]] = entry["job"]
        except (ValueError, KeyError, TypeError):
            continue  # a torn line: at worst a cell waits in the queue twice, and its lock sorts that out
    return [jobs.get(_run(folder, cell)) for cell in cells]


def _run(folder: Path, cell: Cell) -> str:
    """Relative, so that it doesn't matter where the file system is mounted."""
    return os.path.relpath(cell.run.path, folder)
