"""The one command: compose, validate, plan, run. ``python -m src.run --help`` says how.

Relative paths (``results_dir``) lie in the repository, whatever the working directory.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

import hydra
from omegaconf import DictConfig

ROOT = Path(__file__).resolve().parents[1]
PLUGINS = ROOT / "src" / "plugins"  # Hydra finds our launcher and sweeper in its namespace package

if not __package__:  # ``python src/run.py``, the form that Hydra's shell completion knows
    sys.path[0] = str(ROOT)


@hydra.main(version_base="1.3", config_path=str(ROOT / "conf"), config_name="config")
def task(composed: DictConfig) -> str:
    """One run (:mod:`src.experiment.launch.single`); with ``-m`` Hydra calls the sweeper of ``src/plugins`` instead."""
    from src.experiment.launch.single import run_composed

    return run_composed(composed)


def main() -> int:
    """Run the command; bad input is one clear sentence and exit code 2."""
    from src.config.command_line import is_input_error, prepared, sentence
    from src.experiment.state import ExitCode

    show_traceback = os.environ.get("HYDRA_FULL_ERROR") == "1"
    _prepare_process()
    if sys.flags.optimize:
        return _refuse("Python's -O breaks Hydra's range() and glob(); run without it.", ExitCode.REFUSED)
    try:
        sys.argv[1:] = prepared(sys.argv[1:])
        task()
    except Exception as error:
        if show_traceback or not is_input_error(error):
            raise
        return _refuse(sentence(error), ExitCode.REFUSED)
    except SystemExit as stop:  # a single run's errors go around Hydra
        if stop.__cause__ is None:
            raise
        if show_traceback:
            raise stop.__cause__ from None
        return _refuse(str(stop.__cause__), stop.code if isinstance(stop.code, int) else ExitCode.FAILED)
    except KeyboardInterrupt:
        return ExitCode.KILLED_BY_USER
    return ExitCode.DONE


def _prepare_process() -> None:
    """Work from the repository; let our plugins be found, in worker processes too; have Hydra raise, not print."""
    os.chdir(ROOT)
    for path in (PLUGINS, ROOT):
        if str(path) not in sys.path:
            sys.path.insert(0, str(path))
    present = os.environ.get("PYTHONPATH", "").split(os.pathsep)
    wanted = [str(ROOT), str(PLUGINS)]
    os.environ["PYTHONPATH"] = os.pathsep.join([p for p in present if p and p not in wanted] + wanted)
    os.environ["HYDRA_FULL_ERROR"] = "1"


def _refuse(text: str, code: int) -> int:
    print(text, file=sys.stderr)
    return code


if __name__ == "__main__":
    sys.exit(main())
