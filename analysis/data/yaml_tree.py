"""YAML as a plain tree of bounded size: what others wrote must neither fill the memory nor end the report."""

from __future__ import annotations

import math
from typing import Any

import yaml

from analysis.data.errors import UnreadableRunError

#: A resolved configuration has about a hundred values, at most four deep.
MOST_VALUES = 20_000
DEEPEST = 40
_Loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


def load_tree(text: str, name: str) -> Any:
    """Parse one YAML document: dictionaries with text keys, lists, text, finite numbers, booleans and None.

    Whatever else YAML knows (dates, infinities) becomes text. Aliases are allowed, but what they stand for counts.

    Raises:
        UnreadableRunError: no YAML, or more than ``MOST_VALUES`` values when its aliases are written out.
    """
    try:
        _check_size(text, name)
        return _plain(yaml.load(text, Loader=_Loader))
    except (yaml.YAMLError, ValueError, TypeError, RecursionError) as error:
        if isinstance(error, UnreadableRunError):
            raise
        raise UnreadableRunError(f"its {name} cannot be read ({type(error).__name__})") from None


def _check_size(text: str, name: str) -> None:
    """Count the values of the document with its aliases written out, before anything is built from it."""
    sizes = [0]  # of the open collections, the document first
    anchors: dict[str | None, int] = {}
    names: list[str | None] = [None]
    for event in yaml.parse(text, Loader=_Loader):
        if isinstance(event, yaml.AliasEvent):
            sizes[-1] += anchors.get(event.anchor, 1)
        elif isinstance(event, yaml.ScalarEvent):
            sizes[-1] += 1
            if event.anchor:
                anchors[event.anchor] = 1
        elif isinstance(event, yaml.CollectionStartEvent):
            sizes.append(1)
            names.append(event.anchor)
        elif isinstance(event, yaml.CollectionEndEvent):
            size = sizes.pop()
            anchor = names.pop()
            sizes[-1] += size
            if anchor:
                anchors[anchor] = size
        if sizes[-1] > MOST_VALUES:
            raise UnreadableRunError(f"its {name} holds more than {MOST_VALUES:,} values; no configuration does")
        if len(sizes) > DEEPEST:
            raise UnreadableRunError(f"its {name} is nested more than {DEEPEST} deep; no configuration is")


def _plain(node: Any) -> Any:
    if isinstance(node, dict):
        return {str(key): _plain(value) for key, value in node.items()}
    if isinstance(node, list | tuple | set):
        return [_plain(value) for value in node]
    if node is None or isinstance(node, str | bool | int):
        return node
    return node if isinstance(node, float) and math.isfinite(node) else str(node)
