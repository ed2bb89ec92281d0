"""Run one cell in this process: claim its directory, train, record how it ended."""

from __future__ import annotations

import errno
import traceback
from collections.abc import Callable
from contextlib import suppress

from src.config import ExperimentConfig
from src.experiment import manifest as manifests
from src.experiment import threads
from src.experiment.claim import claim
from src.experiment.decision import Action
from src.experiment.manifest import Failure
from src.experiment.outcome import Outcome
from src.experiment.progress import Heartbeat, Progress
from src.experiment.run_directory import RunDirectory
from src.experiment.signals import stop_request

_PLAIN = {
    errno.ENOSPC: "the disk is full",
    errno.EDQUOT: "the disk quota is used up",
    errno.EROFS: "the file system is read-only",
    errno.EACCES: "no permission to write",
    errno.EFBIG: "a file would grow beyond the limit for files",
}


class RunFailedError(Exception):
    """A run ended with an error that is recorded in its directory. The message is for the user."""


def execute(config: ExperimentConfig, progress: Progress, also_stop: Callable[[], bool] | None = None) -> Outcome:
    """Train one cell from wherever it stands.

    Args:
        config: the cell.
        progress: where a person watches.
        also_stop: asked besides the signals of :mod:`src.experiment.signals` whether to stop.

    Raises:
        BusyError: a live process holds the run directory.
        ConfigurationError: another configuration has used the run directory.
        RunFailedError: the run failed; ``failure.txt`` and the manifest say why.
        KeyboardInterrupt: a second SIGINT.
    """
    try:
        return _execute(config, progress, also_stop)
    except OSError as error:  # before the run has begun or after its end: it could not be recorded
        name = RunDirectory(RunDirectory.path_of(config)).name
        raise RunFailedError(f"{name} failed: {reason(error)}") from error


def _execute(config: ExperimentConfig, progress: Progress, also_stop: Callable[[], bool] | None) -> Outcome:
    with claim(config) as (run, decision):
        if decision.action is Action.SKIP:
            return Outcome("complete", decision.step, "already complete")
        if decision.action is Action.DIVERGED:
            return Outcome("diverged", decision.step, decision.reason)
        heartbeat = Heartbeat(run, progress)
        try:
            outcome = _train(config, run, heartbeat, also_stop)
        except KeyboardInterrupt:
            run.update_manifest(
                status="interrupted", step=heartbeat.step, wall_time_seconds=heartbeat.wall_time_seconds
            )
            raise
        except BaseException as error:
            _record_error(run, heartbeat, error)
            raise RunFailedError(
                f"{run.name} failed: {reason(error)} (traceback: {run.path / 'failure.txt'})"
            ) from error
        _record(run, heartbeat, outcome)
        if outcome.status == "complete" and not config.keep_replay:
            _shrink(run)
        run.give_back_reserve()
        return outcome


def _train(
    config: ExperimentConfig, run: RunDirectory, progress: Progress, also_stop: Callable[[], bool] | None
) -> Outcome:
    threads.set_before_torch(config.threads)
    with stop_request() as stop:
        from src.training.session import train  # torch loads here, after the thread variables are set

        threads.set_in_torch(config.threads)
        return train(config, run, progress, stop if also_stop is None else lambda: stop() or also_stop())


def _shrink(run: RunDirectory) -> None:
    """Only after the manifest says ``complete``: a kill in between then costs disk, not the run."""
    from src.training.session import shrink_state

    shrink_state(run)


def _record(run: RunDirectory, heartbeat: Heartbeat, outcome: Outcome) -> None:
    diverged = outcome.status == "diverged"
    run.update_manifest(
        status=outcome.status,
        step=outcome.step,
        wall_time_seconds=heartbeat.wall_time_seconds,
        finished=None if outcome.status == "interrupted" else manifests.now(),
        failure=Failure("diverged", outcome.message, outcome.step) if diverged else None,
    )
    if outcome.status == "complete":
        (run.path / "failure.txt").unlink(missing_ok=True)


def _record_error(run: RunDirectory, heartbeat: Heartbeat, error: BaseException) -> None:
    """Where even this fails (a folder gone read-only) the manifest still says ``running``, and its lock is free."""
    with suppress(OSError):
        run.give_back_reserve()
    with suppress(OSError):
        run.log.error("failed", exc_info=error)
    with suppress(OSError):
        (run.path / "failure.txt").write_text("".join(traceback.format_exception(error)))
    with suppress(OSError):
        record_failure(run, type(error).__name__, reason(error), heartbeat.step, heartbeat.wall_time_seconds)


def record_failure(run: RunDirectory, kind: str, message: str, step: int, wall_time_seconds: float) -> None:
    """Set the manifest to ``failed``."""
    run.update_manifest(
        status="failed",
        finished=manifests.now(),
        step=step,
        wall_time_seconds=wall_time_seconds,
        failure=Failure(kind, message, step),
    )


def reason(error: BaseException) -> str:
    """An error in one line, in plain words where it is the file system's."""
    if isinstance(error, OSError) and error.errno in _PLAIN:
        return f"{_PLAIN[error.errno]} ({error})"
    if isinstance(error, SystemExit):
        return f"the run called sys.exit({error.code})"
    first = str(error).strip().split("\n")[0]
    return f"{type(error).__name__}: {first}" if first else type(error).__name__
