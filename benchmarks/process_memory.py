"""Memory of a running process, where Linux tells: what is its own (anonymous) and what is a file's, mapped."""

from __future__ import annotations

import os
import subprocess
import time
from pathlib import Path
from typing import NamedTuple

import psutil


class Peak(NamedTuple):
    """Megabytes; each is the largest seen, so they need not belong to one moment."""

    resident: float  # what top shows as RES: anonymous and file-backed pages that are in memory
    anonymous: float  # heap, stacks, allocations: what the process costs
    file: float  # pages of mapped files: libraries and the replay; the kernel can drop them
    replay_resident: float  # of them the replay's mapping
    replay_anonymous: float  # private copies of the replay's pages: 0 where it is mapped and not copied


class FailedError(Exception):
    """The watched command failed; the message is the end of its output."""


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
    if not psutil.LINUX:
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
        maps = psutil.Process(process).memory_maps()
    except (psutil.Error, OSError):
        return {}
    anonymous = sum(each.anonymous for each in maps)
    of_replay = [each for each in maps if Path(each.path).name == replay]
    found = {
        "anonymous": anonymous,
        "file": sum(each.rss for each in maps) - anonymous,
        "replay_resident": sum(each.rss for each in of_replay),
        "replay_anonymous": sum(each.anonymous for each in of_replay),
    }
    return {name: size / 1e6 for name, size in found.items()}
