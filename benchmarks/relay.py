"""Training loops in processes of their own that run in turns, or at once.

A *runner* is a function ``runner(turns, **arguments)`` at the top of a module. It runs its loop and calls
``turns.reached(step)`` at every boundary; the call returns when the loop may go on, and False when it should end.

    with Racer(ours, config=config) as racer:
        racer.run(1000)              # to step 1000
        window = racer.run(1500)     # 500 more: how long they took, and which parts of it
"""

from __future__ import annotations

import multiprocessing
import signal
import time
import traceback
from collections.abc import Callable, Sequence
from functools import wraps
from multiprocessing.connection import Connection
from types import TracebackType
from typing import Any, NamedTuple, ParamSpec, TypeVar

P = ParamSpec("P")
R = TypeVar("R")

_TIMEOUT = 300.0


class Window(NamedTuple):
    """What a loop did in one turn."""

    steps: int
    seconds: float
    parts: dict[str, float]  # seconds of the parts that the runner times apart, within ``seconds``

    @property
    def rest(self) -> float:
        """Seconds outside those parts."""
        return self.seconds - sum(self.parts.values())


class RunnerFailedError(Exception):
    """A runner raised; the message is its traceback."""


class Turns:
    """The loop's end: where it waits for its turn."""

    def __init__(self, pipe: Connection) -> None:
        self._pipe = pipe
        self._until: int | None = None
        self._began, self._first = 0.0, 0
        self._parts: dict[str, float] = {}

    def reached(self, step: int) -> bool:
        """Wait here if the turn is over; False: no more turns."""
        if self._until is not None:
            if step < self._until:
                return True
            self._pipe.send(Window(step - self._first, time.perf_counter() - self._began, self._parts))
        self._until = self._pipe.recv()
        if self._until is None:
            return False
        self._parts, self._first = dict.fromkeys(self._parts, 0.0), step
        self._began = time.perf_counter()
        return True

    def timed(self, part: str, call: Callable[P, R]) -> Callable[P, R]:
        """The same function; its time is counted under ``part``."""
        self._parts.setdefault(part, 0.0)

        @wraps(call)
        def timed(*args: P.args, **kwargs: P.kwargs) -> R:
            started = time.perf_counter()
            try:
                return call(*args, **kwargs)
            finally:
                self._parts[part] += time.perf_counter() - started

        return timed


class Racer:
    """The other end: one runner in a fresh process."""

    def __init__(self, runner: Callable[..., None], **arguments: Any) -> None:
        context = multiprocessing.get_context("spawn")
        self._pipe, theirs = context.Pipe()
        self._process = context.Process(target=_serve, args=(theirs, runner, arguments), daemon=True)
        self._process.start()
        theirs.close()

    def begin(self, until: int) -> None:
        """Let it run until ``step >= until`` and don't wait."""
        self._pipe.send(until)

    def result(self) -> Window:
        """Wait until the turn is over.

        Raises:
            RunnerFailedError: the runner raised, died, or took minutes.
        """
        if not self._pipe.poll(_TIMEOUT):
            raise RunnerFailedError(f"no answer for {_TIMEOUT:.0f} s")
        try:
            answer = self._pipe.recv()
        except EOFError:
            raise RunnerFailedError("the process died") from None
        if isinstance(answer, str):
            raise RunnerFailedError(answer)
        assert isinstance(answer, Window)
        return answer

    def run(self, until: int) -> Window:
        """One turn."""
        self.begin(until)
        return self.result()

    def __enter__(self) -> Racer:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is None:
            self._pipe.send(None)
            self._process.join(30)
        self._pipe.close()
        if self._process.is_alive():
            self._process.terminate()
        self._process.join()


def in_turns(racers: Sequence[Racer], warm_up: int, window: int, rounds: int) -> list[list[Window]]:
    """The windows of each racer: all warm up to step ``warm_up``, then each runs ``window`` steps per round.

    Every other round goes backwards, so that a machine that slows down favours nobody.
    """
    for racer in racers:
        racer.begin(1)  # starts of processes may overlap: they are not measured
    for racer in racers:
        racer.result()
    for racer in racers:
        racer.run(warm_up)
    windows: list[list[Window]] = [[] for _ in racers]
    for index in range(rounds):
        order = range(len(racers)) if index % 2 == 0 else reversed(range(len(racers)))
        for which in order:
            windows[which].append(racers[which].run(warm_up + (index + 1) * window))
    return windows


def _serve(pipe: Connection, runner: Callable[..., None], arguments: dict[str, Any]) -> None:
    """In the fresh process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # a Ctrl-C is for the parent, whose end closes the pipe
    try:
        from src.training.numerics import set_numerics

        set_numerics(threads=1)
        runner(Turns(pipe), **arguments)
    except EOFError:
        pass  # the parent has ended: nobody waits for an answer
    except BaseException:
        pipe.send(traceback.format_exc())
