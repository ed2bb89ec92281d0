"""Where run directories lie below ``runs/``, and what lies there that is none."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from analysis.data.errors import InputError

LAYOUT = "<algo>/<env>/<label>/<encoder>/seed_<k>"
_DEPTH = LAYOUT.count("/") + 1


class Found(NamedTuple):
    """Something below ``runs/``: its path there, what is wrong with it (then it is not read), what to say of it."""

    path: str
    wrong: str
    remark: str = ""


def check_study(folder: Path) -> None:
    """Refuse a folder that is no study, before anything is read or written.

    Raises:
        InputError: says what is there instead, and which folder was probably meant.
    """
    if not folder.exists():
        raise InputError(f"There is no folder {folder}: name the folder of a study, such as results/paper.")
    if (folder / "runs").is_dir():
        return
    studies = sorted(path.parent.name for path in folder.glob("*/runs") if path.is_dir()) if folder.is_dir() else []
    above = next((path for path in folder.absolute().parents if (path / "runs").is_dir()), None)
    if studies:
        shown = ", ".join(studies[:5]) + (f" and {len(studies) - 5} more" if len(studies) > 5 else "")
        hint = f"it holds the folders of studies ({shown}): name one, such as {folder / studies[0]}."
    elif above is not None and above.name:
        hint = f"it lies in the study {above.name}: name that folder."
    else:
        hint = "the folder of a study, such as results/paper, holds its run directories in runs/."
    raise InputError(f"{folder} is no study: it has no folder runs; {hint}")


def run_directories(root: Path) -> list[Found]:
    """What lies below ``runs/``, in a fixed order (seeds as numbers): every folder at the depth of ``LAYOUT``, folders
    that end above it, and links.
    """
    return sorted(_below(root, (), root.resolve()), key=_natural)


def _below(folder: Path, parts: tuple[str, ...], root: Path) -> Iterator[Found]:
    try:
        entries = sorted(folder.iterdir())
    except OSError as error:
        yield Found("/".join(parts), f"it cannot be read ({error.strerror})")
        return
    inside = [path for path in entries if not path.name.startswith(".")]
    if len(parts) == _DEPTH:
        yield from _at_depth(inside, parts)
        return
    folders = [path for path in inside if path.is_dir()]
    if parts and not folders:
        yield Found("/".join(parts), f"its path is not {LAYOUT}")
    for path in inside:
        name = path.name.encode("utf-8", "backslashreplace").decode()
        here = (*parts, name)
        if name != path.name:
            yield Found("/".join(here), "its name is not UTF-8")
        elif path.is_symlink() and path.is_dir() and path.resolve().is_relative_to(root):
            yield Found("/".join(here), "it is a link to a folder of the same study")
        elif path.is_dir():
            if path.is_symlink():
                yield Found("/".join(here), "", "it is a link; git does not carry what it leads to")
            yield from _below(path, here, root)
        elif path.is_symlink():
            yield Found("/".join(here), "it is a link that leads nowhere")
        elif name.startswith("seed_"):
            yield Found("/".join(here), "it is no folder")


def _at_depth(inside: list[Path], parts: tuple[str, ...]) -> Iterator[Found]:
    path = "/".join(parts)
    number = parts[-1].removeprefix("seed_")
    well_named = parts[-1].startswith("seed_") and number.isascii() and number.isdecimal()
    yield Found(path, "" if well_named else f"its path is not {LAYOUT}")
    for child in inside:
        if (child / "manifest.json").exists():
            name = child.name.encode("utf-8", "backslashreplace").decode()
            yield Found(f"{path}/{name}", f"its path is not {LAYOUT}")


def _natural(found: Found) -> tuple[str, int, str]:
    cell, _, last = found.path.rpartition("/")
    number = last.removeprefix("seed_")
    return cell, int(number) if number.isascii() and number.isdecimal() else -1, last
