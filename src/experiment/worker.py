"""Train one run in this process: acquire its directory, train, record how it ended.

``python -m src.experiment.worker`` is one job of the local launcher: it reads one run (JSON) from stdin.
"""

from __future__ import annotations

import argparse
import errno
import json
import sys
import traceback
from collections.abc import Callable
from contextlib import suppress

from src.config.identity import Run
from src.config.schema import ConfigurationError
from src.experiment import process
from src.experiment.ownership import BusyError, acquire, record_failure
from src.experiment.progress import Heartbeat, PlainProgress, Progress
from src.experiment.run_directory import Failure, RunDirectory, RunState, now
from src.experiment.state import ExitCode, Next, Outcome

_ERRNO_WORDS = {
    errno.ENOSPC: "the disk is full",
    errno.EDQUOT: "the disk quota is used up",
    errno.EROFS: "the file system is read-only",
    errno.EACCES: "no permission to write",
    errno.EFBIG: "a file would grow beyond the limit for files",
}
#: Of one job of the local launcher; other endings are 0.
_EXIT_CODES = {RunState.BUSY: ExitCode.BUSY, RunState.INTERRUPTED: ExitCode.INTERRUPTED}


class RunFailedError(Exception):
    """A run ended with an error that is recorded in its directory. The message is for the user."""


def execute(run: Run, progress: Progress, also_stop: Callable[[], bool] | None = None) -> Outcome:
    """Train one run from wherever it stands; ``busy`` where a live process holds its directory.

    ``also_stop`` is asked besides the signals of :mod:`src.experiment.process` whether to stop.

    Raises:
        ConfigurationError: another configuration has used the run directory.
        RunFailedError: the run failed; ``failure.txt`` and the manifest say why.
        KeyboardInterrupt: a second SIGINT.
    """
    try:
        return _execute(run, progress, also_stop)
    except BusyError as busy:
        return Outcome(RunState.BUSY, 0, str(busy))
    except OSError as error:  # before the run has begun or after its end: it could not be recorded
        raise RunFailedError(f"{run.name} failed: {reason(error)}") from error


def _execute(run: Run, progress: Progress, also_stop: Callable[[], bool] | None) -> Outcome:
    # signals are ours until the outcome is recorded: a second SIGTERM would leave a manifest that says `running`
    with process.stop_request() as stop, acquire(run) as (directory, found):
        stop_requested = stop if also_stop is None else lambda: stop() or also_stop()
        if found.action is Next.SKIP:
            return Outcome(RunState.COMPLETE, found.step, "already complete")
        if found.action is Next.DIVERGED:
            return Outcome(RunState.DIVERGED, found.step, found.reason)
        heartbeat = Heartbeat(directory, progress)
        try:
            process.set_threads_before_torch(run.config.threads)
            from src.training.session import train  # torch loads here, after the thread variables are set

            outcome = train(run.config, directory, heartbeat, stop_requested)
        except KeyboardInterrupt:
            _record(directory, heartbeat, Outcome(RunState.INTERRUPTED, heartbeat.step))
            raise
        except BaseException as error:
            _record_error(directory, heartbeat, error)
            raise RunFailedError(
                f"{run.name} failed: {reason(error)} (traceback: {run.path / 'failure.txt'})"
            ) from error
        _record(directory, heartbeat, outcome)
        if outcome.status == RunState.COMPLETE and not run.config.keep_replay:
            directory.shrink_state()  # a kill since the manifest says `complete` costs disk, not the run
        directory.give_back_reserve()
        return outcome


def _record(directory: RunDirectory, heartbeat: Heartbeat, outcome: Outcome) -> None:
    diverged = outcome.status == RunState.DIVERGED
    directory.update_manifest(
        status=RunState(outcome.status),
        step=outcome.step,
        wall_time_seconds=heartbeat.wall_time_seconds,
        finished=None if outcome.status == RunState.INTERRUPTED else now(),
        failure=Failure("diverged", outcome.message, outcome.step) if diverged else None,
    )
    if outcome.status == RunState.COMPLETE:
        (directory.path / "failure.txt").unlink(missing_ok=True)


def _record_error(directory: RunDirectory, heartbeat: Heartbeat, error: BaseException) -> None:
    """Where even this fails (a folder gone read-only) the manifest still says ``running``, and its lock is free."""
    with suppress(OSError):
        directory.give_back_reserve()
    with suppress(OSError):
        directory.log.error("failed", exc_info=error)
    with suppress(OSError):
        (directory.path / "failure.txt").write_text("".join(traceback.format_exception(error)))
    with suppress(OSError):
        record_failure(directory, type(error).__name__, reason(error), heartbeat.step, heartbeat.wall_time_seconds)


def reason(error: BaseException) -> str:
    """An error in one line, in plain words where it is the file system's."""
    if isinstance(error, OSError) and error.errno in _ERRNO_WORDS:
        return f"{_ERRNO_WORDS[error.errno]} ({error})"
    if isinstance(error, SystemExit):
        return f"the run called sys.exit({error.code})"
    first = str(error).strip().split("\n")[0]
    return f"{type(error).__name__}: {first}" if first else type(error).__name__


def main() -> int:
    """Run the job of the local launcher whose run is on stdin, and return its exit code."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--parent", type=int, required=True, help="the launcher's process id")
    process.die_with(parser.parse_args().parent)
    try:
        run = Run.from_dict(json.load(sys.stdin))
        outcome = execute(run, PlainProgress(run.config.protocol.total_steps))
    except (ConfigurationError, RunFailedError) as error:
        print(error)
        return ExitCode.REFUSED if isinstance(error, ConfigurationError) else ExitCode.FAILED
    except KeyboardInterrupt:
        return ExitCode.KILLED_BY_USER
    if outcome.status == RunState.BUSY:
        print(outcome.message)
    return _EXIT_CODES.get(outcome.status, ExitCode.DONE)


if __name__ == "__main__":
    sys.exit(main())
