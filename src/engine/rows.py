"""Elementwise passes over rows of n neurons.

Each equation is one pass over a row (joined, they were slower). Every operation is in the order of
:mod:`src.actors.lif` and none is fused or reassociated (no ``fastmath``), so values are equal bit for bit.
"""

from __future__ import annotations

import numpy as np

from src.engine.jit import elementwise

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
