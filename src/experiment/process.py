"""The process of one run: its CPU threads, the signals that stop it, and the launcher that it dies with.

SIGTERM and the first SIGINT ask a run to stop at its next checkpoint; a second SIGINT stops it at once. The number of
threads is set where native libraries read it, before they load.
"""

from __future__ import annotations

import ctypes
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from src.experiment.state import ExitCode

_PR_SET_PDEATHSIG = 1
_WATCH_SECONDS = 1.0
VARIABLES = ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")
#: Threads that spin while they wait for each other bring a run on a busy machine to a standstill (docs/machines.md).
#: OpenMP's can wait passively; OpenBLAS' own can't, so it gets one.
PASSIVE_WAITING = {
    "OMP_WAIT_POLICY": "PASSIVE",
    "GOMP_SPINCOUNT": "0",
    "KMP_BLOCKTIME": "0",
    "OPENBLAS_NUM_THREADS": "1",
}


def thread_environment(threads: int) -> dict[str, str]:
    """The variables for a process that has not loaded torch yet; what the user says about waiting stays."""
    counts = dict.fromkeys(VARIABLES, str(threads))
    if threads == 1:
        return counts | {"OPENBLAS_NUM_THREADS": "1"}
    return counts | {name: value for name, value in PASSIVE_WAITING.items() if name not in os.environ}


def set_threads_before_torch(threads: int) -> None:
    """Set the variables of this process; they count only for libraries that are not loaded yet."""
    os.environ.update(thread_environment(threads))


@contextmanager
def stop_request() -> Iterator[Callable[[], bool]]:
    """Whether a stop has been asked for, by signals whose handlers are installed where nobody else has.

    Submitit's own (SIGTERM ignored) are left alone. A script's background job begins with SIGINT ignored; it stops
    with a checkpoint all the same.
    """
    asked = False

    def terminate(*_: object) -> None:
        nonlocal asked
        asked = True

    def interrupt(*_: object) -> None:
        nonlocal asked
        if asked:
            raise KeyboardInterrupt
        asked = True

    wanted = {
        signal.SIGTERM: ((signal.SIG_DFL,), terminate),
        signal.SIGINT: ((signal.default_int_handler, signal.SIG_IGN), interrupt),
    }
    before: dict[signal.Signals, Any] = {}
    if threading.current_thread() is threading.main_thread():
        for number, (defaults, handler) in wanted.items():
            if signal.getsignal(number) in defaults:
                before[number] = signal.signal(number, handler)
    try:
        yield lambda: asked
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def die_with(parent: int) -> None:
    """A SIGTERM when the launcher dies, however it dies; exit where it is dead already.

    Linux sends it itself; elsewhere a thread looks every second whether we have become somebody else's child.
    """
    prctl = getattr(ctypes.CDLL(None, use_errno=True), "prctl", None)
    if prctl is not None:
        prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)
    else:
        threading.Thread(target=_watch, args=(parent,), daemon=True).start()
    if os.getppid() != parent:
        sys.exit(ExitCode.INTERRUPTED)


def _watch(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(_WATCH_SECONDS)
    os.kill(os.getpid(), signal.SIGTERM)
