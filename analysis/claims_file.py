"""Reading ``claims.yaml``: what is claimed, checked before anything is computed."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from analysis.data.errors import InputError
from analysis.tests_of_claims import MINIMUM_SEEDS

FILE = Path(__file__).with_name("claims.yaml")
_ROLES = {
    "difference": (("better", 1.0), ("worse", -1.0)),
    "interaction": (("both", 1.0), ("first", -1.0), ("second", -1.0), ("neither", 1.0)),
}


@dataclass(frozen=True)
class Claim:
    """``sum_i weights_i * mean(arms_i) > 0`` in final performance."""

    name: str
    text: str
    kind: str
    source: str
    arms: tuple[str, ...]
    weights: tuple[float, ...]


@dataclass(frozen=True)
class Claims:
    """The whole file."""

    alpha: float
    power: float
    tasks: tuple[str, ...]
    claims: tuple[Claim, ...]
    minimum_seeds: int = MINIMUM_SEEDS


def read_claims(path: Path = FILE) -> Claims:
    """Read and check a claims file.

    Raises:
        InputError: one sentence that names the claim and the mistake.
    """
    try:
        content = yaml.safe_load(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise InputError(f"There is no claims file {path}.") from None
    except yaml.YAMLError as error:
        raise InputError(f"{path.name} is not valid YAML: {str(error).splitlines()[0]}.") from None
    if not isinstance(content, dict):
        raise InputError(f"{path.name}: expected the keys alpha, power, tasks and claims.")
    for key, kind in (("alpha", float), ("power", float), ("tasks", list), ("claims", list)):
        if not isinstance(content.get(key), kind):
            raise InputError(f"{path.name}: {key} should be a {kind.__name__}, found {content.get(key)!r}.")
    if not (0 < content["alpha"] < 1 and 0 < content["power"] < 1):
        raise InputError(f"{path.name}: alpha and power lie between 0 and 1.")
    minimum = content.get("minimum_seeds", MINIMUM_SEEDS)
    if not isinstance(minimum, int) or isinstance(minimum, bool) or minimum < MINIMUM_SEEDS:
        raise InputError(f"{path.name}: minimum_seeds is a whole number, at least {MINIMUM_SEEDS}; found {minimum!r}.")
    claims = tuple(_claim(path.name, entry) for entry in content["claims"])
    names = [claim.name for claim in claims]
    if len(set(names)) < len(names):
        raise InputError(f"{path.name}: two claims have the same name.")
    return Claims(content["alpha"], content["power"], tuple(map(str, content["tasks"])), claims, minimum)


def _claim(file: str, entry: Any) -> Claim:
    name = entry.get("name") if isinstance(entry, dict) else None
    if not isinstance(name, str):
        raise InputError(f"{file}: every claim needs a name; found {entry!r}.")
    if entry.get("kind") not in _ROLES:
        raise InputError(f"{file}: claim {name}: kind should be {' or '.join(_ROLES)}, found {entry.get('kind')!r}.")
    if entry.get("source") not in ("paper", "user"):
        raise InputError(f"{file}: claim {name}: source should be paper or user, found {entry.get('source')!r}.")
    roles = _ROLES[entry["kind"]]
    allowed = {"name", "kind", "source", "text", *(role for role, _ in roles)}
    for role, _ in roles:
        if not isinstance(entry.get(role), str):
            raise InputError(f"{file}: claim {name}: {role} should name a label, found {entry.get(role)!r}.")
    if unknown := sorted(set(entry) - allowed):
        raise InputError(f"{file}: claim {name}: there is no key {unknown[0]}.")
    arms = tuple(entry[role] for role, _ in roles)
    return Claim(name, str(entry.get("text", name)), entry["kind"], entry["source"], arms, tuple(w for _, w in roles))
