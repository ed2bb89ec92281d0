"""One run directory, read with suspicion: what ``docs/run-directory.md`` promises is checked, nothing is guessed.

A file that is damaged in a way that could move a number makes the run unreadable (it is listed, and counts nowhere);
what a
kill can leave behind (a torn last line, a half-written evaluation) is left out with a note.
"""

from __future__ import annotations

import io
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import yaml

from analysis.data.errors import InputError

FORMAT = 1
EVALUATION_COLUMNS = ["step", "episode", "return", "length"]
REQUIRED = ("status", "algo", "env", "actor", "label", "encoder", "seed", "cell_hash", "total_steps")
#: What a status means for the numbers: ``finished`` and ``diverged`` count, ``unfinished`` is drawn in curves only.
COUNTS_AS = {
    "complete": "finished",
    "diverged": "diverged",
    "running": "unfinished",
    "interrupted": "unfinished",
    "failed": "unfinished",
}
_Loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


class UnreadableRunError(InputError):
    """A folder that is no run, or a run whose files cannot be trusted."""


@dataclass(frozen=True)
class Run:
    """A run as its files tell it. ``evaluations``: one row per step (``step, return, length, episodes``)."""

    path: str  # algo/env/label/encoder/seed_k
    manifest: dict[str, Any]
    config: dict[str, Any]
    counts_as: str
    evaluations: pd.DataFrame
    training: pd.DataFrame
    warnings: tuple[str, ...]


def read_run(folder: Path, path: str) -> Run:
    """Read one run directory; ``path`` is its place below ``runs/`` and the identity it claims.

    Raises:
        UnreadableRunError: one sentence that says what is wrong with it.
    """
    manifest = _manifest(folder, path)
    config = _config(folder)
    warnings: list[str] = []
    episodes = int(config.get("protocol", {}).get("evaluation_episodes", 1))
    evaluations = _evaluations(folder / "evaluations.csv", episodes, warnings)
    early = int(manifest.get("step") or 0) < int(config["protocol"].get("evaluation_interval") or 0)
    training = _training(folder / "training.csv", warnings, early)
    counts_as = COUNTS_AS[manifest["status"]]
    finite = np.isfinite(evaluations["return"].to_numpy(dtype=float))
    if not finite.all():
        warnings.append(f"{int((~finite).sum())} evaluation(s) hold non-finite returns; the run counts as diverged")
        evaluations, counts_as = evaluations[finite].reset_index(drop=True), "diverged"
    last = int(evaluations["step"].max()) if len(evaluations) else -1
    if counts_as == "finished" and last != manifest["total_steps"]:
        warnings.append(
            f"its manifest says complete, but its evaluations end at step {last:,} of {manifest['total_steps']:,}; "
            "it counts as unfinished"
        )
        counts_as = "unfinished"
    if counts_as == "diverged" and last < 0:
        warnings.append(
            "it diverged before its first evaluation, so there is no value to carry forward; it counts as unfinished"
        )
        counts_as = "unfinished"
    return Run(path, manifest, config, counts_as, evaluations, training, tuple(warnings))


def _manifest(folder: Path, path: str) -> dict[str, Any]:
    try:
        manifest = json.loads((folder / "manifest.json").read_bytes())
    except FileNotFoundError:
        raise UnreadableRunError("it has no manifest.json, so it is no run directory") from None
    except (ValueError, OSError) as error:
        raise UnreadableRunError(f"its manifest.json cannot be read ({type(error).__name__})") from None
    if not isinstance(manifest, dict) or any(key not in manifest for key in REQUIRED):
        missing = [key for key in REQUIRED if not isinstance(manifest, dict) or key not in manifest]
        raise UnreadableRunError(f"its manifest.json lacks {', '.join(missing)}")
    if manifest.get("format", FORMAT) != FORMAT:
        raise UnreadableRunError(f"its manifest.json has format {manifest['format']}, this program reads {FORMAT}")
    if manifest["status"] not in COUNTS_AS:
        raise UnreadableRunError(f"its manifest.json has the unknown status {manifest['status']!r}")
    claimed = "/".join(str(manifest[key]) for key in ("algo", "env", "label", "encoder")) + f"/seed_{manifest['seed']}"
    if claimed != path:
        raise UnreadableRunError(f"its manifest.json says that it is {claimed}: the folder was moved or copied")
    for key in ("seed", "total_steps"):
        if not isinstance(manifest[key], int) or manifest[key] < 0:
            raise UnreadableRunError(f"its manifest.json has {key}={manifest[key]!r}, not a whole number")
    return manifest


def _config(folder: Path) -> dict[str, Any]:
    try:
        config = yaml.load((folder / "config.yaml").read_text(encoding="utf-8"), Loader=_Loader)
    except FileNotFoundError:
        raise UnreadableRunError("it has no config.yaml") from None
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise UnreadableRunError(f"its config.yaml cannot be read ({type(error).__name__})") from None
    if not isinstance(config, dict) or not all(
        isinstance(config.get(k), dict) for k in ("actor", "env", "algo", "protocol")
    ):
        raise UnreadableRunError("its config.yaml is not a resolved configuration with actor, algo, env and protocol")
    return config


def _whole_lines(path: Path, warnings: list[str]) -> list[str]:
    """The lines that end in a newline; what follows the last one was torn by a kill and is left out."""
    try:
        text = path.read_bytes().decode("utf-8")
    except FileNotFoundError:
        warnings.append(f"{path.name} is missing")
        return []
    except UnicodeDecodeError:
        raise UnreadableRunError(f"its {path.name} is not text") from None
    lines = text.split("\n")
    if lines[-1]:
        warnings.append(f"the last line of {path.name} is torn and was left out")
    lines = [line.rstrip("\r") for line in lines[:-1]]
    if lines:
        fields = lines[0].count(",")
        for number, line in enumerate(lines, start=1):
            if line.count(",") != fields:
                raise UnreadableRunError(
                    f"line {number} of its {path.name} has {line.count(',') + 1} fields instead of {fields + 1}"
                )
    return lines


def _evaluations(path: Path, episodes: int, warnings: list[str]) -> pd.DataFrame:
    lines = _whole_lines(path, warnings)
    empty = pd.DataFrame({"step": [], "return": [], "length": [], "episodes": []}).astype(
        {"step": int, "episodes": int}
    )
    if not lines:
        return empty
    if lines[0].split(",") != EVALUATION_COLUMNS:
        raise UnreadableRunError(
            f"its evaluations.csv begins with {lines[0][:60]!r}, not {','.join(EVALUATION_COLUMNS)}"
        )
    if len(lines) == 1:
        return empty
    for number, line in enumerate(lines, start=1):
        if not all(map(str.strip, line.split(","))):
            raise UnreadableRunError(f"line {number} of its evaluations.csv has an empty field")
    # "nan" is a return that is no number: the run diverged; any other word is damage
    rows = pd.read_csv(
        io.StringIO("\n".join(lines)),
        float_precision="round_trip",
        keep_default_na=False,
        na_values=["nan", "-nan", "NaN"],
    )
    for column in EVALUATION_COLUMNS:
        if rows[column].dtype.kind not in ("iu" if column in ("step", "episode") else "iuf"):
            raise UnreadableRunError(f"its evaluations.csv holds something that is no number in column {column}")
    repeated = rows.duplicated(["step", "episode"], keep=False)
    if repeated.any():
        before = len(rows)
        rows = rows.drop_duplicates(EVALUATION_COLUMNS)
        if rows.duplicated(["step", "episode"]).any():
            step = int(rows[rows.duplicated(["step", "episode"])]["step"].iloc[0])
            raise UnreadableRunError(
                f"its evaluations.csv has an episode of step {step:,} twice, with different returns"
            )
        warnings.append(f"{before - len(rows)} repeated row(s) of evaluations.csv were left out")
    # reduceat keeps NaN (groupby.mean would skip it): one non-finite episode makes the evaluation non-finite
    rows = rows.sort_values(["step", "episode"])
    steps, starts, counts = np.unique(rows["step"].to_numpy(), return_index=True, return_counts=True)
    table = pd.DataFrame({"step": steps})
    for column in ("return", "length"):
        table[column] = np.add.reduceat(rows[column].to_numpy(dtype=float), starts) / counts
    table["episodes"] = counts
    partial = table["episodes"] < episodes
    if partial.any():
        where = ", ".join(f"{step:,}" for step in table.loc[partial, "step"].head(3))
        warnings.append(
            f"{int(partial.sum())} evaluation(s) with fewer than {episodes} episodes were left out (step {where})"
        )
    return table[~partial].reset_index(drop=True)


def _training(path: Path, warnings: list[str], early: bool) -> pd.DataFrame:
    """No number of a comparison depends on this file, so damage in it leaves the file out, not the run.

    ``early``: the run has not ended its first interval, so there need be no file.
    """
    nothing = pd.DataFrame({"step": pd.Series(dtype=int)})
    if early and not path.exists():
        return nothing
    try:
        return _trusted_training(path, warnings)
    except UnreadableRunError as error:
        warnings.append(f"{error}; its training data were left out, its evaluations count")
        return nothing


def _trusted_training(path: Path, warnings: list[str]) -> pd.DataFrame:
    lines = _whole_lines(path, warnings)
    if len(lines) < 2 or "step" not in lines[0].split(","):
        return pd.DataFrame({"step": pd.Series(dtype=int)})
    frame = pd.read_csv(io.StringIO("\n".join(lines)), float_precision="round_trip")
    words = [
        column for column in frame.columns if frame[column].dtype.kind not in "iuf" and frame[column].notna().any()
    ]
    if words:
        raise UnreadableRunError(f"its training.csv holds something that is no number in column {words[0]}")
    return frame.drop_duplicates("step", keep="last").sort_values("step").reset_index(drop=True)
