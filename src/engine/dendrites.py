"""Dendritic branches (:mod:`src.actors.synapse`): a layer's weights spread over them, the gradient collected."""

from __future__ import annotations

import numpy as np

from src.engine.jit import inner
from src.engine.rows import ZERO


@inner
def expand_branches(weight, branch, spread):  # type: ignore[no-untyped-def]
    """``spread[m] = weight where branch == m, else 0``; shapes ``[n, inputs]``, ``[n, inputs]``, ``[d, n, inputs]``."""
    for m in range(spread.shape[0]):
        for j in range(weight.shape[0]):
            source, own, target = weight[j], branch[j], spread[m, j]
            for i in range(source.shape[0]):
                value = source[i]  # loaded unconditionally, or the loop is not SIMD
                target[i] = value if own[i] == np.int8(m) else ZERO


@inner
def collect_branches(gathered, branch, spread):  # type: ignore[no-untyped-def]
    """``gathered = spread[m] where branch == m``; shapes as for spreading."""
    for j in range(gathered.shape[0]):
        own, target = branch[j], gathered[j]
        for m in range(spread.shape[0]):
            source = spread[m, j]
            for i in range(target.shape[0]):
                value, others = source[i], target[i]
                target[i] = value if own[i] == np.int8(m) else others
