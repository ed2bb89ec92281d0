"""Dendritic branches (:mod:`src.actors.synapse`): a layer's weights branch by branch, and their gradient collected."""

from __future__ import annotations

import numpy as np

from src.engine.jit import inner
from src.engine.rows import ZERO


@inner
def expand_branches(weight, branch, branch_weights):  # type: ignore[no-untyped-def]
    """``branch_weights[m] = weight where branch == m, else 0``; ``[d, n, inputs]`` of twice ``[n, inputs]``."""
    for m in range(branch_weights.shape[0]):
        for j in range(weight.shape[0]):
            source, own, target = weight[j], branch[j], branch_weights[m, j]
            for i in range(source.shape[0]):
                value = source[i]  # loaded unconditionally, or the loop is not SIMD
                target[i] = value if own[i] == np.int8(m) else ZERO


@inner
def collect_branches(grad_weight, branch, grad_branch_weights):  # type: ignore[no-untyped-def]
    """``grad_weight = grad_branch_weights[m] where branch == m``; shapes as above."""
    for j in range(grad_weight.shape[0]):
        own, target = branch[j], grad_weight[j]
        for m in range(grad_branch_weights.shape[0]):
            source = grad_branch_weights[m, j]
            for i in range(target.shape[0]):
                value, others = source[i], target[i]
                target[i] = value if own[i] == np.int8(m) else others
