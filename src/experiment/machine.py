"""The machine, the commit and what a run ran with: versions, commit, processor model.

What is recorded names no host and no absolute path.
"""

from __future__ import annotations

import hashlib
import os
import platform
import subprocess
from importlib import metadata
from pathlib import Path

from src.paths import ROOT

_DISTRIBUTIONS = ("torch", "torchrl", "tensordict", "gymnasium", "mujoco", "numpy", "numba", "scipy")


def versions() -> dict[str, str | None]:
    """Installed versions, read without importing anything heavy."""
    found: dict[str, str | None] = {"python": platform.python_version()}
    for name in _DISTRIBUTIONS:
        found[name] = _version(name)
    return found | {"hydra": _version("hydra-core")}


def _version(distribution: str) -> str | None:
    try:
        return metadata.version(distribution)
    except metadata.PackageNotFoundError:
        return None


def commit() -> tuple[str | None, bool | None]:
    """The commit of the code and whether src/ or conf/ differ from it; (None, None) without git."""
    head = _git("rev-parse", "HEAD")
    if head is None:
        return None, None
    changes = _git("status", "--porcelain", "--", "src", "conf")
    return head, None if changes is None else bool(changes)


def _git(*arguments: str) -> str | None:
    environment = {**os.environ, "GIT_OPTIONAL_LOCKS": "0"}
    try:
        done = subprocess.run(
            ["git", *arguments], cwd=ROOT, env=environment, capture_output=True, text=True, timeout=30, check=True
        )
    except (OSError, subprocess.SubprocessError):
        return None
    return done.stdout.strip()


def processor() -> str:
    """The processor's model name; where there is none (Linux on ARM), what identifies the model."""
    try:
        lines = [line.partition(":") for line in Path("/proc/cpuinfo").read_text().splitlines()]
        found = {key.strip(): value.strip() for key, _, value in lines}
    except OSError:
        found = {}
    if "model name" in found:
        return found["model name"]
    if "CPU part" in found:
        return f"{platform.machine()} implementer {found.get('CPU implementer')} part {found['CPU part']}"
    return _sysctl("machdep.cpu.brand_string") or platform.processor() or platform.machine() or "unknown"


def _sysctl(name: str) -> str | None:
    """What macOS says."""
    try:
        return subprocess.run(["sysctl", "-n", name], capture_output=True, text=True, check=True).stdout.strip() or None
    except (OSError, subprocess.SubprocessError):
        return None


def usable_cores() -> int:
    """Cores that this process may run on (a container or Slurm may give fewer than the machine has)."""
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:  # macOS
        return os.cpu_count() or 1


def boot_token() -> str:
    """The same for all processes of one boot of one machine, different elsewhere, and tells nothing about it."""
    try:
        boot = Path("/proc/sys/kernel/random/boot_id").read_text().strip()
    except OSError:
        boot = platform.node()  # a lock of the kernel tells of processes of an earlier boot
    return hashlib.sha256(f"spiking-actor-testbed {boot}".encode()).hexdigest()[:16]
