"""The LIF layer's T steps and their gradient by hand: :mod:`src.actors.lif`, sample after sample.

One sample after the other runs through all T steps, so that its state (a few rows of n numbers) stays in the cache.
Each equation is one pass over a row (joined, they were slower). Every operation is in the order of
:mod:`src.actors.lif` and none is fused or reassociated (no ``fastmath``), so values are equal bit for bit.
``constants`` is a record of :data:`src.engine.records.NEURON_CONSTANTS`.
"""

from __future__ import annotations

import numpy as np

from src.engine.jit import elementwise, inner

ZERO, ONE = np.float32(0), np.float32(1)


@elementwise
def fill(row, value):  # type: ignore[no-untyped-def]
    """``row = value``."""
    for j in range(row.shape[0]):
        row[j] = value


@elementwise
def copy(target, source):  # type: ignore[no-untyped-def]
    """``target = source``."""
    for j in range(target.shape[0]):
        target[j] = source[j]


@elementwise
def add(target, a):  # type: ignore[no-untyped-def]
    """``target += a``."""
    for j in range(target.shape[0]):
        target[j] = target[j] + a[j]


@elementwise
def add_product(target, a, b):  # type: ignore[no-untyped-def]
    """``target += a b``."""
    for j in range(target.shape[0]):
        target[j] = target[j] + a[j] * b[j]


@elementwise
def add_shifted(target, a, k, b, shift):  # type: ignore[no-untyped-def]
    """``target[j] += a[k, j + s] b[j + s]``; shapes ``[n]``, ``[K, m]``, ``[m]``."""
    for i in range(target.shape[0]):
        j = np.uint64(i) + shift  # with signed numbers Numba looks for negative ones, and the loop is not SIMD
        target[i] = target[i] + a[k, j] * b[j]


@elementwise
def add_four_shifted(target, a, k, b, s0, s1, s2, s3):  # type: ignore[no-untyped-def]
    """The same for k to k + 3, in order."""
    for i in range(target.shape[0]):
        j = np.uint64(i)
        target[i] = (
            target[i] + a[k, j + s0] * b[j + s0] + a[k + 1, j + s1] * b[j + s1] + a[k + 2, j + s2] * b[j + s2]
            + a[k + 3, j + s3] * b[j + s3]
        )  # fmt: skip


@elementwise
def add_four_products(t0, t1, t2, t3, a, b0, b1, b2, b3):  # type: ignore[no-untyped-def]
    """``t_k += a b_k``; the b may overlap, since they are only read."""
    for j in range(a.shape[0]):
        x = a[j]
        t0[j] = t0[j] + x * b0[j]
        t1[j] = t1[j] + x * b1[j]
        t2[j] = t2[j] + x * b2[j]
        t3[j] = t3[j] + x * b3[j]


@elementwise
def maxout_first(x, branch, z0, z1):  # type: ignore[no-untyped-def]
    """``x = max(z_0, z_1)``; the first wins ties."""
    for j in range(x.shape[0]):
        first, second = z0[j], z1[j]
        branch[j] = second > first
        x[j] = second if second > first else first


@elementwise
def maxout_next(x, branch, z, index):  # type: ignore[no-untyped-def]
    """``x = max(x, z_m)`` for a further branch m."""
    for j in range(x.shape[0]):
        here, before, winner = z[j], x[j], branch[j]
        branch[j] = index if here > before else winner
        x[j] = here if here > before else before


@elementwise
def current(c, x, bias, decay):  # type: ignore[no-untyped-def]
    """``c = d_c c + (x + bias)``."""
    for j in range(c.shape[0]):
        c[j] = decay * c[j] + (x[j] + bias[j])


@elementwise
def membrane(v, o, c, decay):  # type: ignore[no-untyped-def]
    """``v = d_v v (1 - o) + c``."""
    for j in range(v.shape[0]):
        v[j] = decay * v[j] * (ONE - o[j]) + c[j]


@elementwise
def fire(o, v, threshold):  # type: ignore[no-untyped-def]
    """``o = 1[v > v_th]``."""
    for j in range(o.shape[0]):
        o[j] = ONE if v[j] > threshold else ZERO


@elementwise
def membrane_gradient(gv, g, v, o, voltage_decay, threshold, window, reset):  # type: ignore[no-untyped-def]
    """Gradient w.r.t. v_tau from those w.r.t. o_tau and, through decay and reset, v_(tau+1) (``gv`` before)."""
    for j in range(gv.shape[0]):
        through_spike = g[j] - reset * voltage_decay * v[j] * gv[j]
        through_spike = through_spike if abs(v[j] - threshold) < window else ZERO
        gv[j] = through_spike + voltage_decay * (ONE - o[j]) * gv[j]


@elementwise
def current_gradient(gc, gv, decay):  # type: ignore[no-untyped-def]
    """``grad_c_tau = grad_v_tau + d_c grad_c_(tau+1)``."""
    for j in range(gc.shape[0]):
        gc[j] = gv[j] + decay * gc[j]


@elementwise
def branch_gradient(gz, gc, branch, index):  # type: ignore[no-untyped-def]
    """The gradient goes to the branch whose current was the largest."""
    for j in range(gz.shape[0]):
        value = gc[j]  # loaded unconditionally, or the loop is not SIMD
        gz[j] = value if branch[j] == index else ZERO


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
        copy(shifted[k, start : start + n], lateral[k])
    for b in range(samples):
        fill(c, ZERO)
        fill(v, ZERO)
        fill(o, ZERO)
        for t in range(steps):
            if dendrites == 1:
                current(c, currents[t, b, 0], bias, current_decay)
            else:
                for m in range(branch_bias.shape[0]):
                    add(currents[t, b, m], branch_bias[m])
                maxout_first(x, branch, currents[t, b, 0], currents[t, b, 1])
                for m in range(2, dendrites):
                    maxout_next(x, branch, currents[t, b, m], np.int8(m))
                current(c, x, bias, current_decay)
            membrane(v, o, c, voltage_decay)
            if t > 0:
                k = 0
                while k + 3 < neighbours:
                    add_four_shifted(v, shifted, k, padded, shifts[k], shifts[k + 1], shifts[k + 2], shifts[k + 3])
                    k += 4
                while k < neighbours:
                    add_shifted(v, shifted, k, padded, shifts[k])
                    k += 1
            fire(o, v, threshold)
            copy(spikes[t, b], o)
            if saves:
                copy(potentials[t, b], v)
                if dendrites > 1:
                    copy(argmax_branch[t, b], branch)


@inner
def scan_gradient(  # type: ignore[no-untyped-def]
    grad, spikes, potentials, argmax_branch, lateral, offsets, constants, grad_currents, grad_branch_bias, grad_bias,
    grad_lateral,
):  # fmt: skip
    """Fill ``grad_currents`` and add to ``grad_branch_bias``, ``grad_bias`` and ``grad_lateral``.

    Shapes as in the forward pass; ``reset_gradient`` and ``lateral_gradient`` of the constants are 1 or 0: whether the
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
        copy(padded_lateral[k, radius : radius + n], lateral[k])
    o, gv = padded_o[radius : radius + n], padded_gv[radius : radius + n]
    for b in range(samples):
        fill(gv, ZERO)
        fill(gc, ZERO)
        for t in range(steps - 1, -1, -1):
            copy(g, grad[t, b])
            copy(o, spikes[t, b])
            if t < steps - 1:
                k = 0
                while k + 3 < neighbours:
                    add_four_products(
                        grad_lateral[k], grad_lateral[k + 1], grad_lateral[k + 2], grad_lateral[k + 3], gv,
                        padded_o[radius + offsets[k] :], padded_o[radius + offsets[k + 1] :],
                        padded_o[radius + offsets[k + 2] :], padded_o[radius + offsets[k + 3] :],
                    )  # fmt: skip
                    k += 4
                while k < neighbours:
                    add_product(grad_lateral[k], gv, padded_o[radius + offsets[k] :])
                    k += 1
                if lateral_gradient > 0:
                    k = 0
                    while k + 3 < neighbours:
                        add_four_shifted(
                            g, padded_lateral, k, padded_gv, shifts[k], shifts[k + 1], shifts[k + 2], shifts[k + 3]
                        )
                        k += 4
                    while k < neighbours:
                        add_shifted(g, padded_lateral, k, padded_gv, shifts[k])
                        k += 1
            membrane_gradient(gv, g, potentials[t, b], o, voltage_decay, threshold, window, reset)
            current_gradient(gc, gv, current_decay)
            add(grad_bias, gc)
            if dendrites == 1:
                copy(grad_currents[t, b, 0], gc)
            else:
                for m in range(dendrites):
                    branch_gradient(grad_currents[t, b, m], gc, argmax_branch[t, b], np.int8(m))
                for m in range(grad_branch_bias.shape[0]):
                    add(grad_branch_bias[m], grad_currents[t, b, m])
