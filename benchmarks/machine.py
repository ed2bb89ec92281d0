"""What the benchmark ran on and with. No host names, no paths."""

from __future__ import annotations

import os
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path
from typing import Any

from src.experiment import machine


def describe() -> dict[str, Any]:
    """Versions, processor, cores, memory, load and commit, taken before anything is measured."""
    commit, changed = machine.commit()
    return {
        "when": datetime.now(UTC).isoformat(timespec="seconds"),
        "commit": commit,
        "src_or_conf_changed": changed,
        "versions": machine.versions() | {"stable-baselines3": _version("stable-baselines3")},
        "processor": machine.processor(),
        "usable_cores": machine.usable_cores(),
        "memory_gb": round(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 1e9, 1),
        "load_average": [round(x, 2) for x in os.getloadavg()],
        "siblings_of_core_0": _siblings(),
    }


def lines(machine_: dict[str, Any]) -> list[str]:
    """The same for people."""
    versions = ", ".join(f"{name} {version or 'missing'}" for name, version in machine_["versions"].items())
    changed = " with changes in src/ or conf/" if machine_["src_or_conf_changed"] else ""
    load = machine_["load_average"]
    found = [
        f"{machine_['processor']}, {machine_['usable_cores']} usable cores, {machine_['memory_gb']} GB; one thread",
        versions,
        f"commit {(machine_['commit'] or 'unknown')[:12]}{changed}, {machine_['when']}",
        f"load average at the start {load[0]}, {load[1]}, {load[2]}",
    ]
    if load[0] > 0.5:
        found.append("the machine was busy at the start: trust ratios with their quartiles, not milliseconds")
    return found


def _version(distribution: str) -> str | None:
    try:
        return metadata.version(distribution)
    except metadata.PackageNotFoundError:
        return None


def _siblings() -> str | None:
    """What the kernel says shares core 0 (a virtual machine often doesn't know)."""
    try:
        return Path("/sys/devices/system/cpu/cpu0/topology/thread_siblings_list").read_text().strip()
    except OSError:
        return None
