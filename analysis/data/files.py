"""Files that somebody else wrote: regular ones only, of bounded size, as text without a byte order mark."""

from __future__ import annotations

import stat
from pathlib import Path

from analysis.data.errors import UnreadableRunError

MEGABYTE = 2**20


def read_text(path: Path, megabytes: int) -> str:
    """The text of a file of a run directory (UTF-8; a byte order mark is dropped).

    Raises:
        FileNotFoundError: there is none.
        UnreadableRunError: a folder or a pipe of that name, no permission, too large, or no text.
    """
    try:
        about = path.stat()
        if not stat.S_ISREG(about.st_mode):
            raise UnreadableRunError(f"its {path.name} is not a file")
        if about.st_size > megabytes * MEGABYTE:
            raise UnreadableRunError(
                f"its {path.name} has {about.st_size / MEGABYTE:,.0f} MB, no such file has more than {megabytes}"
            )
        text = path.read_bytes().decode("utf-8-sig")
    except FileNotFoundError:
        if path.is_symlink():
            raise UnreadableRunError(f"its {path.name} is a link that leads nowhere") from None
        raise
    except UnicodeDecodeError:
        raise UnreadableRunError(f"its {path.name} is not text") from None
    except OSError as error:
        raise UnreadableRunError(f"its {path.name} cannot be read ({error.strerror or type(error).__name__})") from None
    if "\0" in text:
        raise UnreadableRunError(f"its {path.name} is not text: it holds zero bytes")
    return text


def whole_lines(path: Path, megabytes: int, warnings: list[str]) -> list[str]:
    """The lines of a CSV file that end in a newline; what follows the last one was torn by a kill and is left out.

    Raises:
        UnreadableRunError: as :func:`read_text`; or a line has another number of fields than the first.
    """
    try:
        text = read_text(path, megabytes)
    except FileNotFoundError:
        warnings.append(f"{path.name} is missing")
        return []
    lines = text.split("\n")
    if lines[-1]:
        warnings.append(f"the last line of {path.name} is torn and was left out")
    lines = [line.rstrip("\r") for line in lines[:-1]]
    fields = lines[0].count(",") if lines else 0
    for number, line in enumerate(lines, start=1):
        if line.count(",") != fields:
            raise UnreadableRunError(
                f"line {number} of its {path.name} has {line.count(',') + 1} fields instead of {fields + 1}"
            )
    return lines
