"""The LIF layer's T steps and their gradient by hand: :mod:`src.actors.lif`, sample after sample.

One sample after the other runs through all T steps, so that its state (a few rows of n numbers) stays in the cache.
``constants`` is a record of :data:`src.engine.records.NEURON_CONSTANTS`.
"""

from __future__ import annotations

import numpy as np

from src.engine import rows
from src.engine.jit import inner


@inner
def scan(  # type: ignore[no-untyped-def]
    currents, branch_bias, bias, lateral, offsets, constants, spikes, potentials, argmax_branch, saves
):
    """Fill ``spikes``; where it ``saves`` for a gradient, ``potentials`` and ``argmax_branch`` too.

    Shapes: currents ``[T, B, d, n]``, branch_bias ``[d, n]`` or empty (added in place), bias ``[n]``, lateral
    ``[K, n]``, offsets ``[K]``, the others ``[T, B, n]``.
    """
    current_decay, voltage_decay = constants["current_decay"], constants["voltage_decay"]
    threshold = constants["threshold"]
    steps, samples, dendrites, n = currents.shape
    neighbours = lateral.shape[0]
    radius = 0
    for k in range(neighbours):
        radius = max(radius, abs(offsets[k]))
    c, v, x = np.empty(n, np.float32), np.empty(n, np.float32), np.empty(n, np.float32)
    branch = np.zeros(n, np.int8)
    padded = np.zeros(n + 2 * radius, np.float32)  # zeros beyond the ends of the line
    o = padded[radius : radius + n]
    shifts, shifted = np.empty(neighbours, np.uint64), np.empty((neighbours, n + 2 * radius), np.float32)
    for k in range(neighbours):
        start = radius + offsets[k]
        shifts[k] = start
        rows.copy(shifted[k, start : start + n], lateral[k])
    for b in range(samples):
        rows.fill(c, rows.ZERO)
        rows.fill(v, rows.ZERO)
        rows.fill(o, rows.ZERO)
        for t in range(steps):
            if dendrites == 1:
                rows.current(c, currents[t, b, 0], bias, current_decay)
            else:
                for m in range(branch_bias.shape[0]):
                    rows.add(currents[t, b, m], branch_bias[m])
                rows.maxout_first(x, branch, currents[t, b, 0], currents[t, b, 1])
                for m in range(2, dendrites):
                    rows.maxout_next(x, branch, currents[t, b, m], np.int8(m))
                rows.current(c, x, bias, current_decay)
            rows.membrane(v, o, c, voltage_decay)
            if t > 0:
                k = 0
                while k + 3 < neighbours:
                    rows.add_four_shifted(v, shifted, k, padded, shifts[k], shifts[k + 1], shifts[k + 2], shifts[k + 3])
                    k += 4
                while k < neighbours:
                    rows.add_shifted(v, shifted, k, padded, shifts[k])
                    k += 1
            rows.fire(o, v, threshold)
            rows.copy(spikes[t, b], o)
            if saves:
                rows.copy(potentials[t, b], v)
                if dendrites > 1:
                    rows.copy(argmax_branch[t, b], branch)


@inner
def scan_gradient(  # type: ignore[no-untyped-def]
    grad, spikes, potentials, argmax_branch, lateral, offsets, constants, grad_currents, grad_branch_bias, grad_bias,
    grad_lateral,
):  # fmt: skip
    """Fill ``grad_currents`` and add to ``grad_branch_bias``, ``grad_bias`` and ``grad_lateral``.

    Shapes as in the forward kernel, ``grad`` as ``spikes``; ``reset`` and ``lateral_gradient`` are 1 or 0: whether the
    reset and the lateral term carry gradient to the spikes of the step before.
    """
    current_decay, voltage_decay = constants["current_decay"], constants["voltage_decay"]
    threshold = constants["threshold"]
    window, reset, lateral_gradient = constants["window"], constants["reset_gradient"], constants["lateral_gradient"]
    steps, samples, dendrites, n = grad_currents.shape
    neighbours = lateral.shape[0]
    radius = 0
    for k in range(neighbours):
        radius = max(radius, abs(offsets[k]))
    g, gc = np.empty(n, np.float32), np.empty(n, np.float32)
    padded_o = np.zeros(n + 2 * radius, np.float32)
    padded_gv = np.zeros(n + 2 * radius, np.float32)
    padded_lateral = np.zeros((neighbours, n + 2 * radius), np.float32)
    shifts = np.empty(neighbours, np.uint64)
    for k in range(neighbours):
        shifts[k] = radius - offsets[k]
        rows.copy(padded_lateral[k, radius : radius + n], lateral[k])
    o, gv = padded_o[radius : radius + n], padded_gv[radius : radius + n]
    for b in range(samples):
        rows.fill(gv, rows.ZERO)
        rows.fill(gc, rows.ZERO)
        for t in range(steps - 1, -1, -1):
            rows.copy(g, grad[t, b])
            rows.copy(o, spikes[t, b])
            if t < steps - 1:
                k = 0
                while k + 3 < neighbours:
                    rows.add_four_products(
                        grad_lateral[k], grad_lateral[k + 1], grad_lateral[k + 2], grad_lateral[k + 3], gv,
                        padded_o[radius + offsets[k] :], padded_o[radius + offsets[k + 1] :],
                        padded_o[radius + offsets[k + 2] :], padded_o[radius + offsets[k + 3] :],
                    )  # fmt: skip
                    k += 4
                while k < neighbours:
                    rows.add_product(grad_lateral[k], gv, padded_o[radius + offsets[k] :])
                    k += 1
                if lateral_gradient > 0:
                    k = 0
                    while k + 3 < neighbours:
                        rows.add_four_shifted(
                            g, padded_lateral, k, padded_gv, shifts[k], shifts[k + 1], shifts[k + 2], shifts[k + 3]
                        )
                        k += 4
                    while k < neighbours:
                        rows.add_shifted(g, padded_lateral, k, padded_gv, shifts[k])
                        k += 1
            rows.membrane_gradient(gv, g, potentials[t, b], o, voltage_decay, threshold, window, reset)
            rows.current_gradient(gc, gv, current_decay)
            rows.add(grad_bias, gc)
            if dendrites == 1:
                rows.copy(grad_currents[t, b, 0], gc)
            else:
                for m in range(dendrites):
                    rows.branch_gradient(grad_currents[t, b, m], gc, argmax_branch[t, b], np.int8(m))
                for m in range(grad_branch_bias.shape[0]):
                    rows.add(grad_branch_bias[m], grad_currents[t, b, m])
