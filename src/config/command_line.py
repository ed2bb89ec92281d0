"""The command line before Hydra reads it, and Hydra's and OmegaConf's errors as one clear sentence each."""

from __future__ import annotations

import difflib
import re
from collections.abc import Sequence
from pathlib import Path

from hydra._internal.utils import get_args_parser
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import ChoiceSweep, Override, Sweep, ValueType
from hydra.errors import HydraException
from omegaconf.errors import OmegaConfBaseException

from src.config.schema import ConfigurationError

_NOT_A_NAME = "Config group override must be a string"


def prepared(arguments: Sequence[str]) -> list[str]:
    """The arguments as Hydra takes them: options before overrides, ``~`` in a value expanded.

    Raises:
        ConfigurationError: Hydra would misread one in silence, or die of it.
        SystemExit: an option that there isn't.
    """
    typed = get_args_parser().parse_intermixed_args(list(arguments)).overrides
    options = list(arguments)
    for each in typed:
        options.remove(each)
    overrides = [_with_home(each) for each in typed]
    parsed = [_parsed(each) for each in overrides]
    files = [each for each in parsed if each.key_or_group == "sweeps"]
    if len(files) > 1 or any(each.is_sweep_override() for each in files):
        raise ConfigurationError("sweeps: one sweep file per command; run them one after the other.")
    if any(each.is_add() for each in files):
        raise ConfigurationError(f"{files[0].input_line}: write it without the plus.")
    return options + overrides


def _with_home(argument: str) -> str:
    """``results_dir=~/runs``: the shell leaves it to us, and Hydra's grammar has no ``~`` in values."""
    key, _, value = argument.partition("=")
    if not value.startswith("~"):
        return argument
    path = str(Path(value).expanduser()).replace("\\", "\\\\").replace("'", "\\'")
    return f"{key}='{path}'"


def _parsed(argument: str) -> Override:
    key, equals, _ = argument.partition("=")
    if not argument.startswith("~") and not (key and equals):
        raise ConfigurationError(f"{argument}: should be key=value.")
    try:
        override = OverridesParser.create().parse_override(argument)
    except HydraException as error:
        _, found, reason = str(error).partition("while evaluating ")
        why = f" ({reason.splitlines()[0]})" if found else ""
        raise ConfigurationError(
            f"{argument}: this can't be read{why}; quote a value with special characters, such as \"{key}='a b'\"."
        ) from None
    check_sweep(override)
    return override


def check_sweep(override: Override) -> None:
    """Whether the values of a sweep can be written out one by one.

    Raises:
        ConfigurationError: an interval, or a range among other values.
    """
    key = override.get_key_element()
    if override.value_type == ValueType.INTERVAL_SWEEP:
        raise ConfigurationError(
            f"{override.input_line}: a grid needs single values, such as {key}=0,1,2 or '{key}=range(3)'."
        )
    value = override.value()
    if isinstance(value, ChoiceSweep) and any(isinstance(each, Sweep) for each in value.list):
        raise ConfigurationError(
            f"{override.input_line}: a range can't be mixed with other values; write them all out, "
            f"such as {key}=0,1,2,7."
        )


def is_input_error(error: BaseException) -> bool:
    """Whether a user's input can raise this while Hydra composes."""
    if isinstance(error, ValueError) and str(error).startswith(_NOT_A_NAME):
        return True
    return isinstance(error, ConfigurationError | HydraException | OmegaConfBaseException)


def sentence(error: BaseException) -> str:
    """The part of an error that a user can act on."""
    text = str(error)
    if isinstance(error, ConfigurationError):
        return text
    if text.startswith(_NOT_A_NAME):
        return "A group takes the name of an option (such as actor=popsan), not a number or null."
    cause = str(error.__cause__) if error.__cause__ is not None else ""
    whole = f"{text}\n{cause}"
    for translate in (_unknown_option, _unknown_key, _wrong_type, _needs_multirun):
        if translated := translate(whole):
            return translated
    return " ".join(line.strip() for line in text.splitlines() if line.strip() and "full_key" not in line)


def _unknown_option(text: str) -> str | None:
    found = re.search(r"Could not find '([\w/]+)/([^'/]*)'", text)
    if not found:
        return None
    group, option = found.groups()
    options = re.findall(r"^\t(\S+)$", text.partition("Available options")[2], flags=re.MULTILINE)
    listed = f"there are {', '.join(options)}." if options else "`python -m src.run --help` lists the groups."
    close = "".join(f" (did you mean {each}?)" for each in difflib.get_close_matches(option, options, n=1))
    return f"{group}={option}: there is no such option{close}; {listed}"


def _unknown_key(text: str) -> str | None:
    found = re.search(r"Could not override '([^']+)'", text)
    reasons = ("is not in struct", "not in '", "No match in the defaults list")
    if not found or not any(reason in text for reason in reasons):
        return None
    key = found.group(1)
    if key in ("env.kwargs", "actor.arguments"):
        return f"{key}: it has no such key yet; write +{key}.NAME=... to add one."
    if key.startswith(("env.kwargs.", "actor.arguments.")):
        return f"{key}: there is no such key yet; write +{key}=... to add it."
    return f"{key}: there is no such key; `python -m src.run --cfg job` prints those there are."


def _wrong_type(text: str) -> str | None:
    found = re.search(r"Error merging override (\S+)\s*\n?(.*)", text)
    if not found:
        return None
    reason = found.group(2).strip().rstrip(".")
    if reason == "Cannot merge DictConfig with ListConfig":
        reason = "a list can't take the place of a mapping of keys, nor the other way round"
    return f"{found.group(1)}: {reason}."


def _needs_multirun(text: str) -> str | None:
    found = re.search(r"Sweep parameters '([^']+)' require", text) or re.search(
        r"Ambiguous value for argument '([^']+)'", text
    )
    return f"{found.group(1)}: several values make a grid; add -m to the command." if found else None
