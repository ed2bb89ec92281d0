"""One job of the local launcher: a fresh process that reads one resolved configuration (JSON) from stdin and runs it.

``python -m src.job --parent PID`` is for :mod:`src.experiment.pool`; people use ``python -m src.run``.
"""

from __future__ import annotations

import argparse
import ctypes
import json
import os
import signal
import sys
import threading
import time
import traceback

from src.config import ConfigurationError, validate
from src.experiment.claim import BusyError
from src.experiment.execute import RunFailedError, execute
from src.experiment.outcome import BUSY, DONE, FAILED, INTERRUPTED, KILLED_BY_USER, REFUSED
from src.experiment.progress import PlainProgress

_PR_SET_PDEATHSIG = 1
_WATCH_SECONDS = 1.0


def main() -> int:
    """Run the job and return its exit code (see :mod:`src.experiment.outcome`)."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--parent", type=int, required=True, help="the launcher's process id")
    die_with(parser.parse_args().parent)
    try:
        config = validate(json.load(sys.stdin))
        outcome = execute(config, PlainProgress(config.protocol.total_steps))
    except BusyError as busy:
        print(busy)
        return BUSY
    except ConfigurationError as error:
        print(error)
        return REFUSED
    except KeyboardInterrupt:
        return KILLED_BY_USER
    except RunFailedError as error:
        print(error)
        return FAILED
    except Exception:
        traceback.print_exc()
        return FAILED
    return INTERRUPTED if outcome.status == "interrupted" else DONE


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
        sys.exit(INTERRUPTED)


def _watch(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(_WATCH_SECONDS)
    os.kill(os.getpid(), signal.SIGTERM)


if __name__ == "__main__":
    sys.exit(main())
