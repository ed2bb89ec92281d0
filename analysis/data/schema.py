"""What the analysis needs of ``manifest.json`` and ``config.yaml`` (docs/run-directory.md), as one schema each.

Keys that are not listed here are kept and not checked: a later version of the training code may write more. The types
are strict (``"5000"`` is no number): what has another type was not written by the training code.
"""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from analysis.data.errors import UnreadableRunError

#: The training code's own bound for seeds, NumPy's int64.
MOST = 2**63 - 1
Count = Annotated[int, Field(ge=0, le=MOST)]
#: Ten times a number of steps has to fit as well.
Positive = Annotated[int, Field(ge=1, le=10**15)]
#: Of an observation or an action.
Size = Annotated[int, Field(ge=1, le=10**6)]
Seconds = Annotated[float, Field(ge=0, le=1e12)]


class Status(StrEnum):
    """What a manifest says of its run."""

    RUNNING = "running"
    COMPLETE = "complete"
    INTERRUPTED = "interrupted"
    FAILED = "failed"
    DIVERGED = "diverged"


class _File(BaseModel):
    model_config = ConfigDict(extra="ignore", strict=True, frozen=True, allow_inf_nan=False)


class Parameters(_File):
    """Learnable numbers."""

    actor: Count | None = None
    critic: Count | None = None


class Failure(_File):
    """Why a run failed or diverged."""

    kind: str = "error"
    message: str = ""

    def __str__(self) -> str:
        return " ".join(f"{self.kind}: {self.message}".split())


class Manifest(_File):
    """``manifest.json``."""

    format: Literal[1] = 1
    status: Status
    algo: str
    env: str
    actor: str
    label: str
    encoder: str
    seed: Count
    cell_hash: str
    total_steps: Positive
    hashed_keys: list[str] = []  # empty: written before the training code listed them
    configuration_hash: str | None = None
    engine: Count | None = None
    step: Count | None = None
    changed_keys: dict[str, Any] = {}
    observation_size: Size | None = None
    action_size: Size | None = None
    parameters: Parameters = Parameters()
    wall_time_seconds: Seconds | None = None
    times_resumed: Count | None = None
    versions: dict[str, str | None] = {}
    commit: str | None = None
    dirty: bool | None = None
    processor: str | None = None
    blas: dict[str, str | None] = {}
    backend: str | None = None  # fast or plain; not written by engines 1 and 2
    threads: Count | None = None
    device: str | None = None
    failure: Failure | None = None
    notes: list[str] = []

    @property
    def path(self) -> str:
        """The place below ``runs/`` of the run that this manifest describes."""
        return f"{self.algo}/{self.env}/{self.label}/{self.encoder}/seed_{self.seed}"


class _Named(_File):
    name: str


class Algorithm(_Named):
    """Group ``algo``."""

    actor_learning_rate: Annotated[float, Field(gt=0)] | None = None


class Actor(_Named):
    """Group ``actor``."""

    kind: str | None = None
    coding: str | None = None


class Encoder(_File):
    """Group ``encoder``."""

    coding: str


class Environment(_Named):
    """Group ``env``."""

    spike_coding: str | None = None


class Protocol(_File):
    """Group ``protocol``."""

    evaluation_interval: Positive
    evaluation_episodes: Positive


class Configuration(_File):
    """``config.yaml``, the resolved configuration."""

    algo: Algorithm
    actor: Actor
    encoder: Encoder
    env: Environment
    protocol: Protocol
    seed: Count


def parse_manifest(text: str) -> Manifest:
    """The content of a ``manifest.json``.

    Raises:
        UnreadableRunError: no JSON, or a key is missing or has a value of another type; says which.
    """
    try:
        return Manifest.model_validate_json(text)
    except ValidationError as error:
        raise UnreadableRunError(f"its manifest.json {_sentence(error)}") from None
    except (ValueError, RecursionError) as error:
        raise UnreadableRunError(f"its manifest.json cannot be read ({type(error).__name__})") from None


def check_configuration(tree: Any) -> Configuration:
    """What the analysis uses of a configuration.

    Raises:
        UnreadableRunError: a key is missing or has a value of another type; says which.
    """
    try:
        return Configuration.model_validate(tree)
    except ValidationError as error:
        raise UnreadableRunError(f"its config.yaml {_sentence(error)}") from None


def _sentence(error: ValidationError) -> str:
    """``lacks status and seed``, or ``has step = 'abc' (should be a valid integer)``: missing keys, else the first."""
    found = error.errors(include_url=False, include_context=False)
    if found[0]["type"] == "json_invalid":
        return "cannot be read: it is no JSON"
    missing = [".".join(map(str, one["loc"])) for one in found if one["type"] == "missing"]
    if missing:
        return f"lacks {', '.join(missing)}"
    first = found[0]
    where = ".".join(map(str, first["loc"]))
    if first["type"] == "value_error":
        return f"lacks {first['msg'].removeprefix('Value error, ')}"
    if not where:
        return "is not a table of keys and values"
    value = repr(first["input"])
    shown = value if len(value) <= 60 else f"{value[:57]}..."
    return f"has {where} = {shown} ({first['msg'].removeprefix('Input ')})"
