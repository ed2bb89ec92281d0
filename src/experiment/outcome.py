"""What a call of the trainer comes back with, and the exit codes that follow from it."""

from __future__ import annotations

from typing import Literal, NamedTuple

#: Exit codes of ``python -m src.run`` and of one job.
DONE = 0  # everything asked for is complete (a diverged run is done: it has told what it had to tell)
FAILED = 1  # at least one run failed; the closing table says which and where to read why
REFUSED = 2  # bad input: nothing was started
BUSY = 69  # of one job: another live process holds its run directory
INTERRUPTED = 75  # stopped by a signal, or cells left to another launcher: the same command again goes on
KILLED_BY_USER = 130  # a second Ctrl-C: stopped at once


class Outcome(NamedTuple):
    """How a run ended: ``step`` environment steps are done; ``message`` says why it is not ``complete``."""

    status: Literal["complete", "interrupted", "diverged"]
    step: int
    message: str = ""
