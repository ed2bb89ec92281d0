"""Where the policy file of a run lies."""

from __future__ import annotations

from pathlib import Path

from src.config.schema import ConfigurationError
from src.experiment.run_directory import BEST_POLICY_FILE, POLICY_FILE

FINAL = "final"
BEST = "best"
_NAMES = {FINAL: POLICY_FILE, BEST: BEST_POLICY_FILE}


def policy_path(run: Path, which: str = FINAL) -> Path:
    """The policy file of a run directory, or the path itself where it is a file.

    Args:
        run: a run directory, or a policy file.
        which: of a run directory: ``final`` or ``best``.

    Raises:
        ConfigurationError: there is none; the message says why that may be.
    """
    if run.is_file():
        return run
    path = run / _NAMES[which]
    if which == FINAL and not path.is_file() and (run / "state" / path.name).is_file():  # of a run of engine 1 or 2
        path = run / "state" / path.name
    if path.is_file():
        return path
    if which == BEST:
        raise ConfigurationError(
            f"{run}: no policy of a best evaluation (policy_best.pt) is there. A run keeps it with keep_best=true, "
            "the default, from its first evaluation on."
        )
    raise ConfigurationError(
        f"{run}: no trained policy (policy.pt) is there. A run leaves it when it completes: train it first, "
        "or name the policy file."
    )
