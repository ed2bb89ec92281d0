"""SIGTERM and the first SIGINT ask a run to stop at its next checkpoint; a second SIGINT stops it at once."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any


class StopRequest:
    """Callable that says whether a stop has been asked for."""

    def __init__(self) -> None:
        self._asked = False

    def __call__(self) -> bool:
        """Whether a stop has been asked for."""
        return self._asked

    def terminate(self, _number: int, _frame: FrameType | None) -> None:
        """Handler of SIGTERM."""
        self._asked = True

    def interrupt(self, _number: int, _frame: FrameType | None) -> None:
        """Handler of SIGINT."""
        if self._asked:
            raise KeyboardInterrupt
        self._asked = True


@contextmanager
def stop_request() -> Iterator[StopRequest]:
    """Install the handlers where nobody else has: submitit's own (SIGTERM ignored) are left alone.

    A script's background job begins with SIGINT ignored; it stops with a checkpoint all the same.
    """
    request = StopRequest()
    wanted = {
        signal.SIGTERM: ((signal.SIG_DFL,), request.terminate),
        signal.SIGINT: ((signal.default_int_handler, signal.SIG_IGN), request.interrupt),
    }
    before: dict[signal.Signals, Any] = {}
    if threading.current_thread() is threading.main_thread():
        for number, (defaults, handler) in wanted.items():
            if signal.getsignal(number) in defaults:
                before[number] = signal.signal(number, handler)
    try:
        yield request
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
