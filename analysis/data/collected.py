"""``results/<study>/collected/``: a study's frames as files, so that figures and statistics never parse run
directories.
"""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path

import pandas as pd

from analysis.data.errors import InputError
from analysis.data.folders import check_study
from analysis.data.mixed import Refused
from analysis.data.policies import save_policies
from analysis.data.study import KEYS, Study, read_study
from analysis.data.writing import read_csv, replaced_folder, write_csv, write_json

FORMAT = 7
_TEXT = ["arm", "label", "actor", "encoder", "algo", "env", "path", "cell_hash", "configuration_hash", "commit"]
_TEXT += ["status", "counts_as", "failure", "changed_keys", "versions", "processor", "device", "blas", "backend"]


def collect(folder: Path) -> Study:
    """Read the run directories of a study and write its ``collected/``."""
    study = read_study(folder)
    with replaced_folder(folder / "collected") as out:
        study.warnings += save_policies(study.runs, folder, out)
        write_csv(out / "runs.csv", study.runs)
        write_csv(out / "evaluations.csv", study.evaluations)
        write_csv(out / "training.csv", _six_digits(study.training))
        write_csv(out / "operations.csv", study.operations)
        if len(study.robustness):
            write_csv(out / "robustness.csv", study.robustness)
        about = {
            "format": FORMAT,
            "study": study.name,
            "warnings": study.warnings,
            "configurations": study.configurations,
            "hashed_keys": study.hashed_keys,
            "refused": [asdict(cell) for cell in study.refused],
        }
        write_json(out / "study.json", about)
    return study


def load(folder: Path) -> Study:
    """Read ``collected/`` back.

    Raises:
        InputError: it is not there, or another version of this program wrote it.
    """
    source = folder / "collected"
    again = f"run `python -m analysis collect {folder}`"
    try:
        about = json.loads((source / "study.json").read_bytes())
        if about["format"] != FORMAT:
            raise InputError(f"{source} was written by another version: {again} again.")
        played = {}
        if (source / "robustness.csv").is_file():
            played["robustness"] = read_csv(source / "robustness.csv", dtype={"arm": str, "algo": str, "env": str})
        return Study(
            about["study"],
            **played,
            runs=read_csv(source / "runs.csv", dtype=dict.fromkeys(_TEXT, str)),
            evaluations=read_csv(source / "evaluations.csv", dtype={"arm": str, "algo": str, "env": str}),
            training=read_csv(source / "training.csv", dtype={"arm": str, "algo": str, "env": str}),
            operations=read_csv(source / "operations.csv", dtype={"arm": str, "algo": str, "env": str}),
            configurations=about["configurations"],
            hashed_keys=about["hashed_keys"],
            refused=[Refused(**cell | {"seeds": tuple(cell["seeds"])}) for cell in about["refused"]],
            warnings=about["warnings"],
        )
    except InputError:
        raise
    except (FileNotFoundError, NotADirectoryError):
        check_study(folder)
        raise InputError(f"{folder} has not been collected: {again} first.") from None
    except (OSError, ValueError, TypeError, KeyError) as error:
        raise InputError(f"{source} is damaged ({type(error).__name__}): {again} again.") from None


def _six_digits(training: pd.DataFrame) -> pd.DataFrame:
    """Losses and rates to six significant digits: these files stand in git."""
    rounded = training.copy()
    for column in rounded.columns.difference([*KEYS, "step", "critic_updates", "actor_updates"]):
        if rounded[column].dtype.kind == "f":
            rounded[column] = rounded[column].map(lambda value: float(f"{value:.6g}"))
    return rounded
