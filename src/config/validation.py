"""From plain containers to the schema, and every mistake as a sentence that names the key as the user types it."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

from pydantic import TypeAdapter, ValidationError

from src.config.rules import mistakes, resolved_coding
from src.config.schema import ConfigurationError, ExperimentConfig

_SCHEMA = TypeAdapter(ExperimentConfig)
#: The tags of pydantic's unions, which are no part of a key.
_TAGS = frozenset({"spiking", "mlp", "population_mlp", "custom", "td3", "td3_proxy", "sac"})
_FOLDER_NAME = "letters, digits and _ . , = + - [ ] (it becomes a folder)"
_PATTERNS = {
    "device": "cpu, cuda or cuda:N",
    "target": "the dotted path of a class, such as src.actors.my_actor.MyActor",
}
#: What pydantic calls a type or a limit, as a noun; ``{...}`` are its own values.
_EXPECTED = {
    "string_type": "text",
    "string_too_long": "at most {max_length} characters",
    "int_type": "a whole number",
    "float_type": "a number",
    "finite_number": "a finite number",
    "bool_type": "true or false",
    "literal_error": "{expected}",
    "greater_than": "greater than {gt:g}",
    "greater_than_equal": "at least {ge:g}",
    "less_than": "less than {lt}",
    "less_than_equal": "at most {le}",
    "tuple_type": "a list, such as [256,256]",
    "list_type": "a list",
    "dict_type": "a mapping of keys",
    "dataclass_type": "an option of this group",
    "too_short": "a list of at least {min_length}",
    "too_long": "a list of at most {max_length}",
    "union_tag_invalid": "one of {expected_tags}",
    "none_required": "null",
}


def validate(composed: dict[str, Any]) -> ExperimentConfig:
    """Turn a composed and resolved configuration (plain containers) into the schema.

    Raises:
        ConfigurationError: one sentence per mistake: the key, what was found, what would be right.
    """
    config = parse(composed)
    if found := list(mistakes(config)):
        raise ConfigurationError("\n".join(found))
    return config


def parse(composed: dict[str, Any]) -> ExperimentConfig:
    """The schema's types and ranges only, without the rules between keys.

    Raises:
        ConfigurationError: as :func:`validate`.
    """
    try:
        config = _SCHEMA.validate_json(json.dumps(composed, default=str))
    except ValidationError as error:
        errors = error.errors()
        inner = [each for each in errors if not any(_lies_in(other["loc"], each["loc"]) for other in errors)]
        raise ConfigurationError("\n".join(sentence(each) for each in inner)) from None
    return replace(config, encoder=replace(config.encoder, coding=resolved_coding(config)))


def _lies_in(key: tuple[int | str, ...], group: tuple[int | str, ...]) -> bool:
    return len(key) > len(group) and key[: len(group)] == group


def to_dict(config: ExperimentConfig) -> dict[str, Any]:
    """The inverse of :func:`validate`: plain containers, ready for YAML."""
    content: dict[str, Any] = _SCHEMA.dump_python(config, mode="json")
    return content


def sentence(error: Any, prefix: str = "") -> str:
    """One of pydantic's errors, about the key ``prefix`` + its own."""
    key = prefix + ".".join(str(part) for part in error["loc"] if part not in _TAGS)
    kind = error["type"]
    if kind in ("unexpected_keyword_argument", "extra_forbidden"):
        return f"{key}: there is no such key; `python -m src.run --cfg job` prints those there are."
    if kind in ("missing", "missing_argument"):
        return f"{key}: this key is missing."
    if kind == "union_tag_not_found":
        return f"{key}: {error['ctx']['discriminator']} is missing; choose one of the group's options."
    if kind == "string_pattern_mismatch":
        expected = _PATTERNS.get(str(error["loc"][-1]), _FOLDER_NAME)
    else:
        expected = _EXPECTED.get(kind, str(error["msg"]).removeprefix("Input should be ").rstrip("."))
        expected = expected.format_map(error.get("ctx") or {})
        if kind == "string_type" and isinstance(error["input"], int | float):
            expected += f" (it takes quotes: {key}=\"'{json.dumps(error['input'])}'\")"
    return f"{key}: should be {expected}, found {error['input']!r}."
