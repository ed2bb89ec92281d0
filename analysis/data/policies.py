"""What ``python -m src.watch`` drew of a study's policies, where it lies beside runs: one policy per arm and task."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pandas as pd

from analysis.data.errors import UnreadableRunError
from analysis.data.files import MEGABYTE, read_text
from analysis.data.names import in_order, on_one_line
from analysis.data.pictures import Picture, small_picture
from analysis.data.writing import write_bytes, write_json

#: All pictures of a study together; later ones are left out.
MEGABYTES = 4
KINDS = ("frames", "raster")
_ORIGINALS = ("episode.mp4", "raster.pdf")
_FOLDER = "watch"
_RETURN = re.compile(r": return (-?[\d,]+) in ([\d,]+) steps$")
_LONGEST = 160


def save_policies(runs: pd.DataFrame, study: Path, out: Path) -> list[str]:
    """Write ``policies.json`` and ``policies/*.png`` into ``out``, nothing where no policy was watched; gives notes.

    Of each arm on each task the lowest seed whose pictures can be read. ``runs``: the columns of ``Study.runs``.
    """
    shown: list[dict[str, Any]] = []
    left_out: list[dict[str, Any]] = []
    notes: list[str] = []
    room = MEGABYTES * MEGABYTE
    for algo, env, arm, paths in _arms(runs):
        watched = {seed: path for seed, path in paths.items() if (study / "runs" / path / _FOLDER).is_dir()}
        for seed, path in watched.items():
            pictures = _pictures(study, path, notes)
            if not pictures:
                continue
            who = {"algo": algo, "env": env, "arm": arm, "seed": seed, "seeds": sorted(watched), "path": path}
            room -= sum(len(picture.content) for picture in pictures.values())
            if room < 0:
                left_out.append(who)
                break
            folder = study / "runs" / path / _FOLDER
            shown.append(
                who
                | {
                    "pictures": [_saved(out, len(shown), kind, picture) for kind, picture in pictures.items()],
                    "originals": [name for name in _ORIGINALS if (folder / name).is_file()],
                    **_summary(folder, path, notes),
                }
            )
            break
    if shown or left_out:
        write_json(out / "policies.json", {"shown": shown, "left_out": left_out, "megabytes": MEGABYTES})
    return notes


def _arms(runs: pd.DataFrame) -> Iterator[tuple[str, str, str, dict[int, str]]]:
    """Each arm on each task, in the order of tables, with the paths of its runs by seed."""
    for algo, env, arm in in_order(zip(runs["algo"], runs["env"], runs["arm"])):
        mine = runs[(runs["algo"] == algo) & (runs["env"] == env) & (runs["arm"] == arm)].sort_values("seed")
        yield algo, env, arm, {int(seed): str(path) for seed, path in zip(mine["seed"], mine["path"])}


def _pictures(study: Path, path: str, notes: list[str]) -> dict[str, Picture]:
    found = {}
    for kind in KINDS:
        try:
            found[kind] = small_picture(study / "runs" / path / _FOLDER / f"{kind}.png")
        except FileNotFoundError:
            continue
        except (UnreadableRunError, OSError) as error:
            why = str(error) if isinstance(error, UnreadableRunError) else f"its {kind}.png cannot be read"
            notes.append(f"runs/{path}/{_FOLDER}: {why}; it is not shown.")
    return found


def _saved(out: Path, index: int, kind: str, picture: Picture) -> dict[str, Any]:
    file = f"policies/{index:03d}-{kind}.png"
    write_bytes(out / file, picture.content)
    return {"kind": kind, "file": file, "width": picture.width, "height": picture.height}


def _summary(folder: Path, path: str, notes: list[str]) -> dict[str, Any]:
    """The return and the number of steps of the episode, and which policy it was, from ``summary.txt``."""
    unknown: dict[str, Any] = {"return": None, "steps": None, "policy": ""}
    try:
        first, second = [*read_text(folder / "summary.txt", 1).splitlines(), "", ""][:2]
    except FileNotFoundError:
        return unknown
    except UnreadableRunError as error:
        notes.append(f"runs/{path}/{_FOLDER}: {error}; the return of its episode is not shown.")
        return unknown
    words = on_one_line(second)[:_LONGEST]
    if not (found := _RETURN.search(first)):
        return unknown | {"policy": words}
    return {"return": found[1], "steps": found[2], "policy": words}
