"""Writing files: whole or not at all, and the same bytes for the same content (no clocks, no paths, no hash order)."""

from __future__ import annotations

import contextlib
import json
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pandas as pd


def write_bytes(path: Path, content: bytes) -> None:
    """Replace ``path`` atomically: a reader sees the old file or the new one, never a part."""
    path.parent.mkdir(parents=True, exist_ok=True)
    beside = path.with_name(f".{path.name}.new")
    beside.write_bytes(content)
    beside.replace(path)


def write_text(path: Path, content: str) -> None:
    r"""UTF-8 with ``\n`` line ends on every system."""
    write_bytes(path, content.encode("utf-8"))


def write_json(path: Path, content: Any) -> None:
    """JSON in the order given, indented, no NaN (it is not JSON)."""
    write_text(path, json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False) + "\n")


def write_csv(path: Path, frame: pd.DataFrame) -> None:
    """A CSV whose floats read back exactly (``float_precision="round_trip"``)."""
    write_text(path, frame.to_csv(index=False, lineterminator="\n"))


def read_csv(path: Path, **options: Any) -> pd.DataFrame:
    """The inverse of :func:`write_csv`: only an empty field is missing; a label may be called NA or null."""
    return pd.read_csv(path, float_precision="round_trip", keep_default_na=False, na_values=[""], **options)


@contextlib.contextmanager
def replaced_folder(folder: Path) -> Iterator[Path]:
    """A fresh folder that takes ``folder``'s place when the block ends well, so that nothing stale stays in it."""
    beside = folder.with_name(f".{folder.name}.new")
    shutil.rmtree(beside, ignore_errors=True)
    beside.mkdir(parents=True)
    try:
        yield beside
    except BaseException:
        shutil.rmtree(beside, ignore_errors=True)
        raise
    shutil.rmtree(folder, ignore_errors=True)
    beside.replace(folder)
