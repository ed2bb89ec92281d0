"""Hydra's and OmegaConf's errors as one clear sentence each."""

from __future__ import annotations

import difflib
import re
from collections.abc import Sequence

from hydra.errors import HydraException
from omegaconf.errors import OmegaConfBaseException

from src.config import ConfigurationError

_FLAGS = ("-m", "--multirun", "-r", "--run", "-h", "--help", "--resolve")  # those that take no value
_NOT_A_NAME = "Config group override must be a string"


def is_input_error(error: BaseException) -> bool:
    """Whether a user's input can raise this while Hydra composes."""
    if isinstance(error, ValueError) and str(error).startswith(_NOT_A_NAME):
        return True
    return isinstance(error, ConfigurationError | HydraException | OmegaConfBaseException)


def mistakes_before_hydra(arguments: Sequence[str]) -> str | None:
    """What Hydra would misread in silence or die of."""
    files = [a for a in arguments if re.match(r"\+{0,2}sweeps=", a)]
    if len(files) > 1 or any(re.search(r"[,(\[]", f.split("=", 1)[1]) for f in files):
        return "sweeps: one sweep file per command; run them one after the other."
    if any(f.startswith("+") for f in files):
        return f"{files[0]}: write it without the plus."
    for before, argument in zip(("", *arguments), arguments):
        if argument.startswith(("-", "~")) or (before.startswith("-") and before not in _FLAGS):
            continue  # an option or its value, a deletion: Hydra's to judge
        key, equals, value = argument.partition("=")
        if not key or not equals:
            return f"{argument}: should be key=value."
        if re.search(r"\b(range|glob|choice|interval)\([^()]*\)\s*,|,\s*(range|glob|choice|interval)\(", value):
            return f"{argument}: a range can't be mixed with other values; write them all out, such as {key}=0,1,2,7."
        if re.match(r"interval\(", value):
            return f"{argument}: a grid needs single values, such as {key}=0,1,2 or '{key}=range(3)'."
    return None


def sentence(error: BaseException) -> str:
    """The part of an error that a user can act on."""
    text = str(error)
    if isinstance(error, ConfigurationError):
        return text
    if text.startswith(_NOT_A_NAME):
        return "A group takes the name of an option (such as actor=popsan), not a number or null."
    cause = str(error.__cause__) if error.__cause__ is not None else ""
    whole = f"{text}\n{cause}"
    for tell in (_unknown_option, _unknown_key, _wrong_type, _needs_multirun, _unreadable):
        told = tell(whole)
        if told:
            return told
    return " ".join(line.strip() for line in text.splitlines() if line.strip() and "full_key" not in line)


def _unknown_option(text: str) -> str | None:
    found = re.search(r"Could not find '([\w/]+)/([^'/]*)'", text)
    if not found:
        return None
    group, option = found.groups()
    options = re.findall(r"^\t(\S+)$", text.partition("Available options")[2], flags=re.MULTILINE)
    listed = f"there are {', '.join(options)}." if options else "`python -m src.run --help` lists the groups."
    return f"{group}={option}: there is no such option{_closest(option, options)}; {listed}"


def _unknown_key(text: str) -> str | None:
    found = re.search(r"Could not override '([^']+)'", text)
    reasons = ("is not in struct", "not in '", "No match in the defaults list")
    if not found or not any(reason in text for reason in reasons):
        return None
    key = found.group(1)
    if key.startswith(("env.kwargs.", "actor.arguments.")):
        return f"{key}: there is no such key yet; write +{key}=... to add it."
    return f"{key}: there is no such key; `python -m src.run --cfg job` prints those there are."


def _wrong_type(text: str) -> str | None:
    found = re.search(r"Error merging override (\S+)\s*\n?(.*)", text)
    return f"{found.group(1)}: {found.group(2).strip().rstrip('.')}." if found else None


def _needs_multirun(text: str) -> str | None:
    found = re.search(r"Sweep parameters '([^']+)' require", text) or re.search(
        r"Ambiguous value for argument '([^']+)'", text
    )
    return f"{found.group(1)}: several values make a grid; add -m to the command." if found else None


def _unreadable(text: str) -> str | None:
    if "override_grammar" not in text:
        return None
    return f"The command line can't be read: {text.splitlines()[0]}; quote values with special characters."


def _closest(option: str, options: Sequence[str]) -> str:
    close = difflib.get_close_matches(option, options, n=1)
    return f" (did you mean {close[0]}?)" if close else ""
