"""Which arms share a panel: all of them where they can be told apart, else groups, each beside the baselines."""

from __future__ import annotations

import numpy as np

from analysis.claims_file import Claims

MOST = 7  # lines in one panel


def facets(arms: list[str], claims: Claims) -> list[list[str]]:
    """The arms in one group, or in several of nearly equal size that all begin with the baselines; none is alone."""
    if len(arms) <= MOST:
        return [arms]
    shared = [arm for arm in arms if arm in claims.baselines]
    others = [arm for arm in arms if arm not in shared]
    count = -(-len(others) // max(MOST - len(shared), 2))
    return [shared + list(map(str, group)) for group in np.array_split(np.array(others, dtype=object), count)]
