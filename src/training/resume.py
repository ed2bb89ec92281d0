"""What a resume needs of a run directory: its newest whole checkpoint, and logs that reach as far."""

from __future__ import annotations

from typing import Any

from src.config.schema import ProtocolConfig
from src.experiment.progress import Progress
from src.experiment.run_directory import RunDirectory
from src.training.checkpoint import CheckpointFolder
from src.training.errors import CorruptState


def newest_checkpoint(run: RunDirectory, progress: Progress) -> dict[str, Any] | None:
    """The content of the newest whole checkpoint; None for a run that has not written one yet.

    Raises:
        CorruptState: the run has written checkpoints, and none of them is left whole.
    """
    content, notes = CheckpointFolder(run.state).load()
    for note in notes:
        progress.note(note)
    if content is None and (step := run.manifest.checkpoint_step) is not None:
        raise CorruptState(
            f"the checkpoint of step {step} is gone: restore this run's state/ folder, or start the run over "
            "with on_conflict=replace"
        )
    return content


def check_logs(run: RunDirectory, protocol: ProtocolConfig, step: int) -> None:
    """Refuse to go on behind rows that are gone: the curve would lack its beginning in silence.

    Args:
        run: the run directory.
        protocol: when rows are written.
        step: of the checkpoint that the run goes on from.

    Raises:
        CorruptState: a log lacks rows that were written before the checkpoint.
    """
    points = range(0, step + 1, protocol.evaluation_interval)
    expected = {
        run.evaluations: [point for point in points for _ in range(protocol.evaluation_episodes)],
        run.training: list(points[1:]),
    }
    for log, steps in expected.items():
        try:
            whole = log.steps(step) == steps
        except ValueError:
            whole = False
        if not whole:
            raise CorruptState(
                f"{log.path.name} was changed or deleted: its rows up to step {step} are not those that "
                "this run wrote. Restore the file, or start the run over with on_conflict=replace."
            )
