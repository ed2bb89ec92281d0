"""Published returns, ``published.yaml``, and which of them may stand beside a study's: none but their like."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from functools import cache
from pathlib import Path
from typing import Annotated, Literal

import yaml
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from analysis.data.errors import InputError

FILE = Path(__file__).with_name("published.yaml")
NOT_STATED = "not stated"
TASKS = ("hopper", "walker2d", "halfcheetah", "ant")
#: The tasks of this repository that a published Ant may stand beside, by the dimensions of its observations.
_ANTS = {111: ("ant", "ant_zero_contact"), 27: ("ant_no_contact",)}


class Statistic(StrEnum):
    """What a published number is of the curves of its seeds (``analysis.metrics``)."""

    MAX_OF_MEAN = "max_of_mean"
    MEAN_OF_MAX = "mean_of_max"
    FINAL = "final"


@dataclass(frozen=True)
class PublishedScore:
    """One number of one table; None where the source does not say.

    Attributes:
        labels: the labels of this repository that are this actor.
        version: of the task, such as ``v3``; ``dimensions``: of Ant's observations, None on other tasks.
        steps: of a run, without ``random_steps`` that the source does not count.
        mean: over ``seeds`` seeds, and their standard deviation.
    """

    source: str
    algorithm: str
    actor: str
    labels: tuple[str, ...]
    task: str
    version: str | None
    dimensions: int | None
    steps: int | None
    random_steps: int
    seeds: int | None
    statistic: Statistic | None
    mean: float
    std: float | None

    def beside_task(self, env: str) -> bool:
        """Whether ``env`` of this repository is this task: v4 has v3's dynamics, v5 has not."""
        if self.task != "ant":
            names: tuple[str, ...] = (self.task,)
        else:
            names = _ANTS.get(self.dimensions or 0, ())
        return env in (tuple(f"{name}_v5" for name in names) if self.version == "v5" else names)

    def beside_steps(self, steps: int) -> bool:
        """Whether runs of so many steps are as long; the random ones before may be counted or not."""
        return self.steps is not None and steps in (self.steps, self.steps + self.random_steps)


_STRICT = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)
_Name = Annotated[str, Field(min_length=1)]
_Count = Annotated[int, Field(ge=1)]


class _Score(BaseModel):
    model_config = _STRICT
    mean: float
    std: Annotated[float, Field(ge=0)] | None


class _Row(BaseModel):
    model_config = _STRICT
    algorithm: Literal["td3", "td3_proxy", "sac"]
    actor: _Name
    labels: Annotated[list[_Name], Field(min_length=1)]
    hopper: _Score | None = None
    walker2d: _Score | None = None
    halfcheetah: _Score | None = None
    ant: _Score | None = None


class _Table(BaseModel):
    model_config = _STRICT
    source: _Name
    version: Literal["v3", "v4", "v5"] | None
    ant_dimensions: Literal[111, 27] | None
    steps: _Count | None
    random_steps: Annotated[int, Field(ge=0)] = 0
    seeds: _Count | None
    statistic: Literal["max_of_mean", "mean_of_max", "final"] | None
    rows: Annotated[list[_Row], Field(min_length=1)]

    def scores(self) -> list[PublishedScore]:
        """Every number of the table."""
        return [
            PublishedScore(
                source=self.source,
                algorithm=row.algorithm,
                actor=row.actor,
                labels=tuple(row.labels),
                task=task,
                version=self.version,
                dimensions=self.ant_dimensions if task == "ant" else None,
                steps=self.steps,
                random_steps=self.random_steps,
                seeds=self.seeds,
                statistic=Statistic(self.statistic) if self.statistic else None,
                mean=score.mean,
                std=score.std,
            )
            for row in self.rows
            for task in TASKS
            if (score := getattr(row, task)) is not None
        ]


class _File(BaseModel):
    model_config = _STRICT
    tables: list[_Table]


@cache
def published(path: Path = FILE) -> tuple[PublishedScore, ...]:
    """Every published number, in the order of the file.

    Raises:
        InputError: one sentence that names the key, and the mistake.
    """
    try:
        file = _File.model_validate(yaml.safe_load(path.read_text(encoding="utf-8")))
    except FileNotFoundError:
        raise InputError(f"There is no file {path}.") from None
    except yaml.YAMLError as error:
        raise InputError(f"{path.name} is not valid YAML: {str(error).splitlines()[0]}.") from None
    except ValidationError as error:
        raise InputError(f"{path.name}: {_sentence(error)}.") from None
    return tuple(score for table in file.tables for score in table.scores())


def _sentence(error: ValidationError) -> str:
    """``tables 2, rows 1, hopper, mean: should be a valid number, found 'x'``: the first mistake; numbered from 1."""
    first = error.errors()[0]
    key = ""
    for part in first["loc"]:
        key += f" {part + 1}" if isinstance(part, int) else f", {part}" if key else str(part)
    if first["type"] == "missing":
        return f"the key {key} is missing"
    if first["type"] == "extra_forbidden":
        return f"there is no key {key}"
    return f"{key or 'it'}: {first['msg'].removeprefix('Input ')}, found {first['input']!r}"
