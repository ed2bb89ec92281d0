"""Memory of a running process, from Linux's /proc: what is its own (anonymous) and what is a file's, mapped."""

from __future__ import annotations

import os
import subprocess
import time
from pathlib import Path
from typing import NamedTuple


class Peak(NamedTuple):
    """Megabytes; each is the largest seen, so they need not belong to one moment."""

    resident: float  # what top shows as RES: anonymous and file-backed pages that are in memory
    anonymous: float  # heap, stacks, allocations: what the process costs
    file: float  # pages of mapped files: libraries and the replay; the kernel can drop them
    replay_resident: float  # of them the replay's mapping
    replay_anonymous: float  # private copies of the replay's pages: 0 where it is mapped and not copied


class FailedError(Exception):
    """The watched command failed; the message is the end of its output."""


_ROLLUP = Path("/proc/self/smaps_rollup")


def watch(command: list[str], cwd: Path, output: Path, replay: str, every: float = 0.5) -> Peak:
    """Run a command to its end and watch its memory.

    Args:
        command: a command that stays one process.
        cwd: where it runs.
        output: a file for what it prints.
        replay: the name of the replay's file in its mappings.
        every: seconds between two looks.

    Raises:
        FailedError: its exit code is not 0, or this machine does not tell.
    """
    if not _ROLLUP.exists():
        raise FailedError("memory is watched in Linux's /proc, which this machine does not have")
    peak = dict.fromkeys(("anonymous", "file", "replay_resident", "replay_anonymous"), 0.0)
    with output.open("w") as file:
        process = subprocess.Popen(command, cwd=cwd, stdout=file, stderr=subprocess.STDOUT)
        while True:
            pid, status, usage = os.wait4(process.pid, os.WNOHANG)
            if pid:
                break
            for key, value in look(process.pid, replay).items():
                peak[key] = max(peak[key], value)
            time.sleep(every)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise FailedError(output.read_text()[-2000:])
    return Peak(resident=usage.ru_maxrss * 1024 / 1e6, **peak)


def look(process: int, replay: str) -> dict[str, float]:
    """Megabytes at this moment; nothing where the process has just ended."""
    try:
        total = _fields((Path("/proc") / str(process) / "smaps_rollup").read_text())
        mapping = _mapping((Path("/proc") / str(process) / "smaps").read_text(), replay)
    except OSError:
        return {}
    anonymous = total.get("Anonymous", 0.0)
    return {
        "anonymous": anonymous,
        "file": total.get("Rss", 0.0) - anonymous,
        "replay_resident": mapping.get("Rss", 0.0),
        "replay_anonymous": mapping.get("Anonymous", 0.0),
    }


def _fields(text: str) -> dict[str, float]:
    """``Rss:  1740 kB`` lines as megabytes."""
    found: dict[str, float] = {}
    for line in text.splitlines():
        parts = line.split()
        if len(parts) == 3 and parts[2] == "kB":
            name = parts[0].rstrip(":")
            found[name] = found.get(name, 0.0) + int(parts[1]) * 1024 / 1e6
    return found


def _mapping(smaps: str, name: str) -> dict[str, float]:
    """The fields of the mappings of one file."""
    kept, inside = [], False
    for line in smaps.splitlines():
        if not line.split(" ", 1)[0].endswith(":"):  # a header: addresses, permissions, ..., path
            inside = line.endswith(f"/{name}")
        elif inside:
            kept.append(line)
    return _fields("\n".join(kept))
