"""Who may write in a run directory: one process at a time.

Two means, because neither suffices alone:

- A kernel lock on ``state/lock``. It dies with its owner, so the lock of a dead process never blocks.
- Where a file system doesn't carry locks between machines: a run whose manifest says ``running``, whose last sign of
  life (``updated``) is younger than :data:`FRESH_SECONDS` and which was claimed under another boot than ours
  (``state/owner``, a token that names no machine) is taken to be alive. A job that was requeued to another machine
  waits until the sign of life is old or moves (:func:`wait_for_silence`).
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

from filelock import FileLock, Timeout

from src.experiment import manifest as manifests
from src.experiment.atomic import replace_file
from src.experiment.machine import boot_token

#: A running manifest of another machine with an older sign of life belongs to a dead process.
FRESH_SECONDS = 300.0
#: How long a claim tries: a plan or a status may look at the lock for an instant.
CLAIM_SECONDS = 3.0


def lock_of(run: Path) -> FileLock:
    """The lock of a run directory (which must exist), not yet taken."""
    (run / "state").mkdir(parents=True, exist_ok=True)
    return FileLock(run / "state" / "lock")


def held_here(run: Path) -> bool:
    """Whether a live process that this kernel can see holds the run directory."""
    path = run / "state" / "lock"
    if not path.exists():
        return False
    lock = FileLock(path)
    try:
        lock.acquire(timeout=0)
    except Timeout:
        return True
    except OSError:
        return False  # a lock that we may not even open is no sign of a live process
    lock.release()
    return False


def alive_elsewhere(run: Path, manifest: manifests.Manifest | None) -> bool:
    """Whether another machine has given a sign of life within :data:`FRESH_SECONDS`."""
    if manifest is None or manifest.status != "running" or _owner(run) in (None, boot_token()):
        return False
    return manifests.seconds_since(manifest.updated) < FRESH_SECONDS


def sign_owner(run: Path) -> None:
    """Note under which boot the run directory was claimed."""
    replace_file(run / "state" / "owner", boot_token().encode())  # a torn one would look like another machine's


def wait_for_silence(run: Path, sleep: Callable[[float], None] = time.sleep) -> bool:
    """With the lock held: wait until another machine's sign of life is old (True) or has moved (False: it lives)."""
    first = manifests.read(run / "manifest.json")
    current = first
    while alive_elsewhere(run, current):
        if current is not None and first is not None and current.updated != first.updated:
            return False
        sleep(5.0)
        current = manifests.read(run / "manifest.json")
    return True


def _owner(run: Path) -> str | None:
    try:
        return (run / "state" / "owner").read_text()
    except OSError:
        return None
