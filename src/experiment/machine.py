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

_PACKAGES = ("torch", "torchrl", "tensordict", "gymnasium", "mujoco", "numpy", "numba", "scipy")


def versions() -> dict[str, str | None]:
    """Installed versions, read without importing anything heavy; None of what is not installed."""
    found: dict[str, str | None] = {"python": platform.python_version()}
    for name, distribution in (*((each, each) for each in _PACKAGES), ("hydra", "hydra-core")):
        try:
            found[name] = metadata.version(distribution)
        except metadata.PackageNotFoundError:
            found[name] = None
    return found


def commit() -> tuple[str | None, bool | None]:
    """The commit of the code and whether src/ or conf/ differ from it; (None, None) without git."""
    head = _output("git", "rev-parse", "HEAD")
    if head is None:
        return None, None
    changes = _output("git", "status", "--porcelain", "--", "src", "conf")
    return head, None if changes is None else bool(changes)


def _output(*command: str) -> str | None:
    """What a program prints; None where there is none, or it fails."""
    environment = {**os.environ, "GIT_OPTIONAL_LOCKS": "0"}
    try:
        done = subprocess.run(
            command, cwd=ROOT, env=environment, capture_output=True, text=True, timeout=30, check=True
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
    return (
        _output("sysctl", "-n", "machdep.cpu.brand_string") or platform.processor() or platform.machine() or "unknown"
    )


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
