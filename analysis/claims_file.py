"""Reading ``claims.yaml``: what is claimed and by which rule it is judged, checked before anything is computed."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any, Literal

import yaml
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError, model_validator

from analysis.data.errors import InputError
from analysis.hypothesis_tests import TEST_SEEDS

#: The key of a random policy's return among reference scores.
RANDOM = "random"
FILE = Path(__file__).with_name("claims.yaml")


class Kind(StrEnum):
    """The contrast of a claim."""

    DIFFERENCE = "difference"  # better - worse
    INTERACTION = "interaction"  # (both - first) - (second - neither)


class Family(StrEnum):
    """Claims that are corrected together."""

    DECLARED = "declared"  # `source: paper`
    USER = "user"  # `source: user`
    EXPLORATORY = "exploratory"  # made automatically for labels that no claim names


@dataclass(frozen=True)
class Claim:
    """``sum_i weights_i * mean(arms_i) > 0`` in final performance, on each of ``tasks``.

    ``removes``: the confounds that its arms do not have, where it is a control of another claim.
    """

    name: str
    text: str
    kind: Kind
    family: Family
    arms: tuple[str, ...]
    weights: tuple[float, ...]
    tasks: tuple[str, ...]
    removes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Claims:
    """The whole file.

    Attributes:
        reference_scores: returns by task and ``random`` or algorithm.
        tasks_planned: whether ``tasks`` are a plan, as in a study's own file: until all of them are there, its verdicts
            are interim. The project's file lists the paper's tasks, of which a study may run some.
    """

    alpha: float
    power: float
    planned_seeds: int
    interim_alpha: float
    smallest_effect: float
    failure_score: float
    baselines: tuple[str, ...]
    tasks: tuple[str, ...]
    claims: tuple[Claim, ...]
    reference_scores: dict[str, dict[str, float]] = field(default_factory=dict)
    tasks_planned: bool = False


_STRICT = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)
_Name = Annotated[str, Field(min_length=1)]
#: A list, or the one name that it would hold.
_Names = Annotated[list[_Name], BeforeValidator(lambda value: [value] if isinstance(value, str) else value)]
_Share = Annotated[float, Field(gt=0, lt=1)]


class _Entry(BaseModel):
    model_config = _STRICT
    name: _Name
    source: Literal["paper", "user"]
    text: str = ""
    removes: _Names = []

    def claim(self, kind: Kind, tasks: tuple[str, ...], **roles: float) -> Claim:
        """The claim that an entry states; ``roles``: the weight of the arm that each key names."""
        arms = tuple(getattr(self, role) for role in roles)
        if len(set(arms)) < len(arms):
            raise ValueError(f"claim {self.name} names the same label twice")
        family = Family.DECLARED if self.source == "paper" else Family.USER
        text = self.text or self.name
        return Claim(self.name, text, kind, family, arms, tuple(roles.values()), tasks, tuple(self.removes))


class _Difference(_Entry):
    kind: Literal["difference"]
    better: _Name
    worse: _Name

    def stated(self, tasks: tuple[str, ...]) -> Claim:
        return self.claim(Kind.DIFFERENCE, tasks, better=1.0, worse=-1.0)


class _Interaction(_Entry):
    kind: Literal["interaction"]
    both: _Name
    first: _Name
    second: _Name
    neither: _Name

    def stated(self, tasks: tuple[str, ...]) -> Claim:
        return self.claim(Kind.INTERACTION, tasks, both=1.0, first=-1.0, second=-1.0, neither=1.0)


class _File(BaseModel):
    model_config = _STRICT
    alpha: _Share
    power: _Share
    planned_seeds: Annotated[int, Field(ge=TEST_SEEDS)]
    interim_alpha: _Share
    smallest_effect: Annotated[float, Field(gt=0)]
    failure_score: float = 50.0
    reference_scores: dict[_Name, dict[_Name, float]] = {}
    baselines: list[_Name] = ["aan", "popsan"]
    tasks: Annotated[list[_Name], Field(min_length=1)]
    claims: list[Annotated[_Difference | _Interaction, Field(discriminator="kind")]]

    @model_validator(mode="after")
    def _rules_between_keys(self) -> _File:
        if self.interim_alpha >= self.alpha:
            raise ValueError(f"interim_alpha ({self.interim_alpha:g}) should be below alpha ({self.alpha:g})")
        for what, names in (("task", self.tasks), ("claim", [entry.name for entry in self.claims])):
            if twice := next((name for name in names if names.count(name) > 1), ""):
                raise ValueError(f"{what} {twice} stands there twice")
        for task, scores in self.reference_scores.items():
            for algo in scores:
                if algo != RANDOM and not scores[algo] > scores.get(RANDOM, -math.inf):
                    raise ValueError(f"reference_scores: {algo} on {task} should be above {RANDOM}")
        return self


def claims_path(study: Path, given: Path | None = None) -> Path:
    """The file that holds for a study: the one that was given, else the study's own, else the project's."""
    own = study / "claims.yaml"
    return given or (own if own.is_file() else FILE)


def read_claims(path: Path = FILE) -> Claims:
    """Read and check a claims file.

    Raises:
        InputError: one sentence that names the key or claim, and the mistake.
    """
    try:
        content = yaml.safe_load(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise InputError(f"There is no claims file {path}.") from None
    except yaml.YAMLError as error:
        raise InputError(f"{path.name} is not valid YAML: {str(error).splitlines()[0]}.") from None
    if not isinstance(content, dict):
        raise InputError(f"{path.name}: expected the keys {', '.join(_File.model_fields)}.")
    try:
        file = _File.model_validate(content)
        tasks = tuple(file.tasks)
        claims = tuple(entry.stated(tasks) for entry in file.claims)
    except ValidationError as error:
        raise InputError(f"{path.name}: {_sentence(content, error.errors()[0])}.") from None
    except ValueError as error:
        raise InputError(f"{path.name}: {error}.") from None
    return Claims(
        alpha=file.alpha,
        power=file.power,
        planned_seeds=file.planned_seeds,
        interim_alpha=file.interim_alpha,
        smallest_effect=file.smallest_effect,
        failure_score=file.failure_score,
        baselines=tuple(file.baselines),
        tasks=tasks,
        claims=claims,
        reference_scores=file.reference_scores,
        tasks_planned=path.resolve() != FILE.resolve(),
    )


def _sentence(content: dict[str, Any], error: Any) -> str:
    """Where the first mistake is, what was found, and what would be right."""
    location, kind = list(error["loc"]), error["type"]
    where = ""
    if location[:1] == ["claims"] and len(location) > 1:
        entry = content["claims"][location[1]]
        name = entry.get("name") if isinstance(entry, dict) else None
        where = f"claim {name if isinstance(name, str) else location[1] + 1}: "
        location = location[3:]  # without claims, its index and its kind
    key = ".".join(str(part + 1 if isinstance(part, int) else part) for part in location)
    if kind == "extra_forbidden":
        return f"{where}there is no key {key}"
    if kind == "missing":
        return f"{where}the key {key} is missing"
    if kind == "value_error":
        return str(error["ctx"]["error"])
    if kind in ("union_tag_invalid", "union_tag_not_found"):
        found = error["input"].get("kind") if isinstance(error["input"], dict) else error["input"]
        return f"{where}kind should be difference or interaction, found {found!r}"
    if kind == "model_attributes_type":
        return f"{where}should be a mapping with name, kind, source and labels, found {error['input']!r}"
    message = error["msg"].removeprefix("Input ")
    return f"{where}{key} {message}, found {error['input']!r}"
