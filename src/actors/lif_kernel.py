"""The spiking layer on the CPU, in Numba: :func:`src.actors.lif.lif_reference` and its gradient by hand, alone and in
one call with what surrounds them in a layer: the spreading of the weights over the branches, and the products, from
BLAS. There the currents and their gradient, the layer's largest arrays, live inside the call only.

One sample after the other runs through all T steps, so that its state (a few rows of n numbers) stays in the cache.
Each equation is one pass over a row (joined, they were slower). Every operation is in the order of the reference and
none is fused or reassociated (no ``fastmath``), so values are equal bit for bit.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
from numba import carray, float32, int8, int64, njit, void

from src.actors.kernels import bytes_at, compiled, disjoint, floats_at
from src.blas import call_sgemm

ZERO, ONE = np.float32(0), np.float32(1)
LINE = 64  # bytes of a cache line, at which every buffer begins

_ROW, _ROWS, _STEPS = float32[::1], float32[:, ::1], float32[:, :, ::1]
_CURRENTS, _BRANCH, _OFFSETS = float32[:, :, :, ::1], int8[:, :, ::1], int64[::1]
_FORWARD = void(_CURRENTS, _ROWS, _ROW, _ROWS, _OFFSETS, float32, float32, float32, _STEPS, _STEPS, _BRANCH)
_BACKWARD = void(
    _STEPS, _STEPS, _STEPS, _BRANCH, _ROWS, _OFFSETS, float32, float32, float32, float32, float32, float32,
    _CURRENTS, _ROWS, _ROW, _ROWS,
)  # fmt: skip
_SPREAD = void(_ROWS, int8[:, ::1], _STEPS)
_TABLE = int64[:, ::1]
_NETWORK_FORWARD = void(
    int64, int64, int64, int64, int64, _OFFSETS, _TABLE, _TABLE, _OFFSETS, float32, float32, float32, int64, int64
)  # fmt: skip
_NETWORK_BACKWARD = void(
    int64, int64, int64, int64, int64, int64, int64, _OFFSETS, _TABLE, _TABLE, _TABLE, _OFFSETS, float32, float32,
    float32, float32, float32, float32, _ROWS, int64,
)  # fmt: skip


def _fill(row, value):  # type: ignore[no-untyped-def]
    for j in range(row.shape[0]):
        row[j] = value


def _copy(target, source):  # type: ignore[no-untyped-def]
    for j in range(target.shape[0]):
        target[j] = source[j]


def _add(target, a):  # type: ignore[no-untyped-def]
    for j in range(target.shape[0]):
        target[j] = target[j] + a[j]


def _add_product(target, a, b):  # type: ignore[no-untyped-def]
    for j in range(target.shape[0]):
        target[j] = target[j] + a[j] * b[j]


def _add_shifted(target, a, k, b, shift):  # type: ignore[no-untyped-def]
    """``target[j] += a[k, j + s] b[j + s]``; shapes ``[n]``, ``[K, m]``, ``[m]``."""
    for i in range(target.shape[0]):
        j = np.uint64(i) + shift  # with signed numbers Numba looks for negative ones, and the loop is not SIMD
        target[i] = target[i] + a[k, j] * b[j]


def _add_four_shifted(target, a, k, b, s0, s1, s2, s3):  # type: ignore[no-untyped-def]
    """The same for k to k + 3, in order."""
    for i in range(target.shape[0]):
        j = np.uint64(i)
        target[i] = (
            target[i] + a[k, j + s0] * b[j + s0] + a[k + 1, j + s1] * b[j + s1] + a[k + 2, j + s2] * b[j + s2]
            + a[k + 3, j + s3] * b[j + s3]
        )  # fmt: skip


def _add_four_products(t0, t1, t2, t3, a, b0, b1, b2, b3):  # type: ignore[no-untyped-def]
    """``t_k += a b_k``; the b may overlap, since they are only read."""
    for j in range(a.shape[0]):
        x = a[j]
        t0[j] = t0[j] + x * b0[j]
        t1[j] = t1[j] + x * b1[j]
        t2[j] = t2[j] + x * b2[j]
        t3[j] = t3[j] + x * b3[j]


def _maxout_first(x, branch, z0, z1):  # type: ignore[no-untyped-def]
    """``x = max(z_0, z_1)``; the first wins ties."""
    for j in range(x.shape[0]):
        first, second = z0[j], z1[j]
        branch[j] = second > first
        x[j] = second if second > first else first


def _maxout_next(x, branch, z, index):  # type: ignore[no-untyped-def]
    """``x = max(x, z_m)`` for a further branch m."""
    for j in range(x.shape[0]):
        here, before, winner = z[j], x[j], branch[j]
        branch[j] = index if here > before else winner
        x[j] = here if here > before else before


def _current(c, x, bias, decay):  # type: ignore[no-untyped-def]
    """``c = d_c c + (x + bias)``."""
    for j in range(c.shape[0]):
        c[j] = decay * c[j] + (x[j] + bias[j])


def _membrane(v, o, c, decay):  # type: ignore[no-untyped-def]
    """``v = d_v v (1 - o) + c``."""
    for j in range(v.shape[0]):
        v[j] = decay * v[j] * (ONE - o[j]) + c[j]


def _fire(o, v, threshold):  # type: ignore[no-untyped-def]
    """``o = 1[v > v_th]``."""
    for j in range(o.shape[0]):
        o[j] = ONE if v[j] > threshold else ZERO


def _membrane_gradient(gv, g, v, o, voltage_decay, threshold, window, reset):  # type: ignore[no-untyped-def]
    """Gradient to v_tau from that to o_tau and, through decay and reset, from that to v_(tau+1) (``gv`` before)."""
    for j in range(gv.shape[0]):
        through_spike = g[j] - reset * voltage_decay * v[j] * gv[j]
        through_spike = through_spike if abs(v[j] - threshold) < window else ZERO
        gv[j] = through_spike + voltage_decay * (ONE - o[j]) * gv[j]


def _current_gradient(gc, gv, decay):  # type: ignore[no-untyped-def]
    """``grad_c_tau = grad_v_tau + d_c grad_c_(tau+1)``."""
    for j in range(gc.shape[0]):
        gc[j] = gv[j] + decay * gc[j]


def _branch_gradient(gz, gc, branch, index):  # type: ignore[no-untyped-def]
    """The gradient goes to the branch that was the largest."""
    for j in range(gz.shape[0]):
        value = gc[j]  # loaded unconditionally, or the loop is not SIMD
        gz[j] = value if branch[j] == index else ZERO


def _forward(  # type: ignore[no-untyped-def]
    currents, branch_bias, bias, lateral, offsets, current_decay, voltage_decay, threshold, spikes, potentials, branches
):
    """Fill ``spikes``; and ``potentials`` and ``branches`` where they are not empty (acting needs neither).

    Shapes: currents ``[T, B, d, n]``, branch_bias ``[d, n]`` or empty (added in place), bias ``[n]``, lateral
    ``[K, n]``, offsets ``[K]``, the others ``[T, B, n]``.
    """
    steps, samples, dendrites, n = currents.shape
    neighbours = lateral.shape[0]
    keep = potentials.shape[0] > 0
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
        _copy(shifted[k, start : start + n], lateral[k])
    for b in range(samples):
        _fill(c, ZERO)
        _fill(v, ZERO)
        _fill(o, ZERO)
        for t in range(steps):
            if dendrites == 1:
                _current(c, currents[t, b, 0], bias, current_decay)
            else:
                for m in range(branch_bias.shape[0]):
                    _add(currents[t, b, m], branch_bias[m])
                _maxout_first(x, branch, currents[t, b, 0], currents[t, b, 1])
                for m in range(2, dendrites):
                    _maxout_next(x, branch, currents[t, b, m], np.int8(m))
                _current(c, x, bias, current_decay)
            _membrane(v, o, c, voltage_decay)
            if t > 0:
                k = 0
                while k + 3 < neighbours:
                    _add_four_shifted(v, shifted, k, padded, shifts[k], shifts[k + 1], shifts[k + 2], shifts[k + 3])
                    k += 4
                while k < neighbours:
                    _add_shifted(v, shifted, k, padded, shifts[k])
                    k += 1
            _fire(o, v, threshold)
            _copy(spikes[t, b], o)
            if keep:
                _copy(potentials[t, b], v)
                if dendrites > 1:
                    _copy(branches[t, b], branch)


def _backward(  # type: ignore[no-untyped-def]
    grad, spikes, potentials, branches, lateral, offsets, current_decay, voltage_decay, threshold, window, reset,
    through_lateral, grad_currents, grad_branch_bias, grad_bias, grad_lateral,
):  # fmt: skip
    """Fill ``grad_currents`` and add to ``grad_branch_bias``, ``grad_bias`` and ``grad_lateral``.

    Shapes as in the forward kernel, ``grad`` as ``spikes``; ``reset`` and ``through_lateral`` are 1 or 0: whether the
    reset and the lateral term carry gradient to the spikes of the step before.
    """
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
        _copy(padded_lateral[k, radius : radius + n], lateral[k])
    o, gv = padded_o[radius : radius + n], padded_gv[radius : radius + n]
    for b in range(samples):
        _fill(gv, ZERO)
        _fill(gc, ZERO)
        for t in range(steps - 1, -1, -1):
            _copy(g, grad[t, b])
            _copy(o, spikes[t, b])
            if t < steps - 1:
                k = 0
                while k + 3 < neighbours:
                    _add_four_products(
                        grad_lateral[k], grad_lateral[k + 1], grad_lateral[k + 2], grad_lateral[k + 3], gv,
                        padded_o[radius + offsets[k] :], padded_o[radius + offsets[k + 1] :],
                        padded_o[radius + offsets[k + 2] :], padded_o[radius + offsets[k + 3] :],
                    )  # fmt: skip
                    k += 4
                while k < neighbours:
                    _add_product(grad_lateral[k], gv, padded_o[radius + offsets[k] :])
                    k += 1
                if through_lateral > 0:
                    k = 0
                    while k + 3 < neighbours:
                        _add_four_shifted(
                            g, padded_lateral, k, padded_gv, shifts[k], shifts[k + 1], shifts[k + 2], shifts[k + 3]
                        )
                        k += 4
                    while k < neighbours:
                        _add_shifted(g, padded_lateral, k, padded_gv, shifts[k])
                        k += 1
            _membrane_gradient(gv, g, potentials[t, b], o, voltage_decay, threshold, window, reset)
            _current_gradient(gc, gv, current_decay)
            _add(grad_bias, gc)
            if dendrites == 1:
                _copy(grad_currents[t, b, 0], gc)
            else:
                for m in range(dendrites):
                    _branch_gradient(grad_currents[t, b, m], gc, branches[t, b], np.int8(m))
                for m in range(grad_branch_bias.shape[0]):
                    _add(grad_branch_bias[m], grad_currents[t, b, m])


def _spread(weight, branch, spread):  # type: ignore[no-untyped-def]
    """``spread[m] = weight where branch == m, else 0``; shapes ``[n, inputs]``, ``[n, inputs]``, ``[d, n, inputs]``."""
    for m in range(spread.shape[0]):
        for j in range(weight.shape[0]):
            source, own, target = weight[j], branch[j], spread[m, j]
            for i in range(source.shape[0]):
                value = source[i]  # loaded unconditionally, or the loop is not SIMD
                target[i] = value if own[i] == np.int8(m) else ZERO


def _gather(gathered, branch, spread):  # type: ignore[no-untyped-def]
    """``gathered = spread[m] where branch == m``; shapes as for spreading."""
    for j in range(gathered.shape[0]):
        own, target = branch[j], gathered[j]
        for m in range(spread.shape[0]):
            source = spread[m, j]
            for i in range(target.shape[0]):
                value, others = source[i], target[i]
                target[i] = value if own[i] == np.int8(m) else others


def _product(gemm, a, a_transposed, b, b_transposed, c):  # type: ignore[no-untyped-def]
    """``C = op(A) op(B)``, row by row: Fortran's ``C^T = op(B)^T op(A)^T``; ``gemm`` is the product's address."""
    rows, columns = c.shape
    inner = a.shape[0] if a_transposed else a.shape[1]
    sizes = np.array([columns, rows, inner, b.shape[1], a.shape[1], columns], np.int64)
    factors = np.array([1, 0], np.float32)
    flags = np.array([ord("T") if b_transposed else ord("N"), ord("T") if a_transposed else ord("N")], np.uint8)
    call_sgemm(gemm, flags, sizes, factors, int64(b.ctypes.data), int64(a.ctypes.data), int64(c.ctypes.data))


def _aligned(count):  # type: ignore[no-untyped-def]
    """Uninitialised floats that begin at a cache line: a product's bits may hang on its alignment."""
    memory = np.empty(count + LINE // 4, np.float32)
    start = -int64(memory.ctypes.data) % LINE // 4
    return memory[start : start + count]


def _layer_forward(  # type: ignore[no-untyped-def]
    gemm, x, weight, branch, matrix, branch_bias, bias, lateral, offsets, current_decay, voltage_decay, threshold,
    spikes, potentials, branches,
):  # fmt: skip
    """The scans of ``x matrix^T``; ``matrix`` is first filled from ``weight`` and ``branch`` unless that is empty.

    Shapes: x ``[G*T*B, inputs]``, weight and branch ``[n, inputs]``, matrix ``[d*n, inputs]``, spikes ``[G, T, B, n]``;
    potentials and branches ``[K, T, B, n]`` of the last K minibatches (of branches none where d is 1); the others as of
    the scan.
    """
    groups, steps, samples, n = spikes.shape
    width, inputs = matrix.shape
    dropped = groups - potentials.shape[0]
    if branch.shape[0] > 0:
        _spread(weight, branch, matrix.reshape(width // n, n, inputs))
    if width == n:  # a spike takes the place of its current
        currents = spikes.reshape(groups * steps * samples, n)
    else:
        currents = _aligned(groups * steps * samples * width).reshape(groups * steps * samples, width)
    _product(gemm, x, False, matrix, True, currents)
    by_group = currents.reshape(groups, steps, samples, width // n, n)
    for g in range(groups):
        kept = potentials[g - dropped] if g >= dropped else np.empty((0, 0, 0), np.float32)
        largest = branches[g - dropped] if g >= dropped and width > n else np.empty((0, 0, 0), np.int8)
        _forward(
            by_group[g], branch_bias, bias, lateral, offsets, current_decay, voltage_decay, threshold, spikes[g], kept,
            largest,
        )  # fmt: skip


def _layer_backward(  # type: ignore[no-untyped-def]
    gemm, grad, x, branch, matrix, spikes, potentials, branches, lateral, offsets, current_decay, voltage_decay,
    threshold, window, reset, through_lateral, coding_gradient, grad_x, grad_weight, grad_branch_bias, grad_bias,
    grad_lateral,
):  # fmt: skip
    """Fill the gradients to x, or with a ``coding_gradient`` ``[1, T]`` to the strength ``[B, inputs]`` that x encodes,
    (none, where ``grad_x`` is empty) and to the weight ``[n, inputs]``; add to those to the biases and lateral weights.
    ``grad`` is overwritten.
    """
    steps, samples, n = spikes.shape
    width, inputs = matrix.shape
    if width == n:  # in place of that to the spikes
        grad_currents = grad.reshape(steps * samples, n)
    else:
        grad_currents = _aligned(steps * samples * width).reshape(steps * samples, width)
    _backward(
        grad, spikes, potentials, branches, lateral, offsets, current_decay, voltage_decay, threshold, window, reset,
        through_lateral, grad_currents.reshape(steps, samples, width // n, n), grad_branch_bias, grad_bias,
        grad_lateral,
    )  # fmt: skip
    if branch.shape[0] > 0:
        spread = _aligned(width * inputs).reshape(width, inputs)
        _product(gemm, grad_currents, True, x, False, spread)
        _gather(grad_weight, branch, spread.reshape(width // n, n, inputs))
    else:
        _product(gemm, grad_currents, True, x, False, grad_weight)
    if coding_gradient.shape[0] > 0 and grad_x.shape[0] > 0:
        summed = _aligned(samples * width).reshape(samples, width)
        by_step = grad_currents.reshape(steps, samples * width)
        _product(gemm, coding_gradient, False, by_step, False, summed.reshape(1, samples * width))
        _product(gemm, summed, False, matrix, False, grad_x)
    elif grad_x.shape[0] > 0:
        _product(gemm, grad_currents, False, matrix, False, grad_x)


def _floats(address, shape):  # type: ignore[no-untyped-def]
    return carray(floats_at(address), shape)


def _bytes(address, shape):  # type: ignore[no-untyped-def]
    return carray(bytes_at(address), shape)


def _columns(row):  # type: ignore[no-untyped-def]
    return row[0], row[1], row[2], row[3], row[4], row[5], row[6], row[7]


def _network_forward(  # type: ignore[no-untyped-def]
    gemm, x, groups, steps, samples, sizes, parameters, places, offsets, current_decay, voltage_decay, threshold, kept,
    rates,
):  # fmt: skip
    """Layer after layer, and the firing rates of the last, for G minibatches at once.

    As addresses, 0 for none: ``x`` of ``[G*T*B, sizes[0]]``, ``rates`` of ``[G*B, sizes[L]]`` and for layer k

    ``parameters[k]``: weight, bias, lateral, how many neighbours, branch of each synapse (where the weight is to be
    spread), branch weights (where it is not), how many branches, whether each branch has a bias.
    ``places[k]``: of spikes, potentials, largest branches (both of the last ``kept`` minibatches) and branch weights.
    """
    layers = parameters.shape[0]
    x = _floats(x, (groups * steps * samples, sizes[0]))
    rates = _floats(rates, (groups * samples, sizes[layers]))
    for k in range(layers):
        n_in, n = sizes[k], sizes[k + 1]
        weight, bias, lateral, neighbours, branch, matrix, dendrites, by_branch = _columns(parameters[k])
        spikes = _floats(places[k, 0], (groups, steps, samples, n))
        zeros = np.zeros(n if by_branch else 0, np.float32)
        _layer_forward(
            gemm,
            x,
            _floats(weight, (n, n_in)),
            _bytes(branch, (n if branch != 0 else 0, n_in)),
            _floats(matrix if matrix != 0 else places[k, 3], (dendrites * n, n_in)),
            _floats(bias, (dendrites if by_branch else 0, n)),
            zeros if by_branch else _floats(bias, (n,)),
            _floats(lateral, (neighbours, n)),
            offsets, current_decay, voltage_decay, threshold,
            spikes,
            _floats(places[k, 1], (kept, steps, samples, n)),
            _bytes(places[k, 2], (kept if dendrites > 1 else 0, steps, samples, n)),
        )  # fmt: skip
        x = spikes.reshape(groups * steps * samples, n)
    n = sizes[layers]
    last = _floats(places[layers - 1, 0], (groups, steps, samples, n))
    for g in range(groups):
        for b in range(samples):
            rate = rates[g * samples + b]
            _fill(rate, ZERO)
            for t in range(steps):
                _add(rate, last[g, t, b])
            for j in range(n):
                rate[j] = rate[j] / np.float32(steps)


def _network_backward(  # type: ignore[no-untyped-def]
    gemm, grad_raw, decoder, actions, x, steps, samples, sizes, parameters, places, gradients, offsets, current_decay,
    voltage_decay, threshold, window, reset, through_lateral, coding_gradient, grad_strength,
):  # fmt: skip
    """From the gradient to the raw action ``[B, M]`` of a decoder ``[M, P]`` to ``gradients[k]``, the addresses of
    those of weight, bias and lateral weights, filled; and with a ``coding_gradient`` ``[1, T]`` to the strength
    ``[B, sizes[0]]`` that x encodes, unless its address is 0. The others, too, come by address; M is ``actions``.
    """
    layers = parameters.shape[0]
    nothing = np.empty((0, 0), np.float32)
    n = sizes[layers]
    grad_raw, decoder = _floats(grad_raw, (samples, actions)), _floats(decoder, (actions, n // actions))
    x = _floats(x, (steps * samples, sizes[0]))
    grad_strength = _floats(grad_strength, (samples if grad_strength != 0 else 0, sizes[0]))
    grad = _aligned(steps * samples * n).reshape(steps, samples, n)
    for b in range(samples):
        for m in range(decoder.shape[0]):
            for p in range(decoder.shape[1]):
                grad[0, b, m * decoder.shape[1] + p] = grad_raw[b, m] * decoder[m, p] / np.float32(steps)
    for t in range(1, steps):
        _copy(grad[t].reshape(samples * n), grad[0].reshape(samples * n))
    for k in range(layers - 1, -1, -1):
        n_in, n = sizes[k], sizes[k + 1]
        _, _, lateral, neighbours, branch, matrix, dendrites, by_branch = _columns(parameters[k])
        grad_lateral = _floats(gradients[k, 2], (neighbours, n))
        grad_branch_bias = _floats(gradients[k, 1], (dendrites if by_branch else 0, n))
        unused = np.empty(n if by_branch else 0, np.float32)
        grad_bias = unused if by_branch else _floats(gradients[k, 1], (n,))
        _fill(grad_bias, ZERO)
        for m in range(grad_branch_bias.shape[0]):
            _fill(grad_branch_bias[m], ZERO)
        for neighbour in range(neighbours):
            _fill(grad_lateral[neighbour], ZERO)
        below = _aligned((steps if k > 0 else 0) * samples * n_in).reshape(steps if k > 0 else 0, samples, n_in)
        _layer_backward(
            gemm,
            grad,
            x if k == 0 else _floats(places[k - 1, 0], (steps * samples, n_in)),
            _bytes(branch, (n if branch != 0 else 0, n_in)),
            _floats(matrix if matrix != 0 else places[k, 3], (dendrites * n, n_in)),
            _floats(places[k, 0], (steps, samples, n)),
            _floats(places[k, 1], (steps, samples, n)),
            _bytes(places[k, 2], (steps if dendrites > 1 else 0, samples, n)),
            _floats(lateral, (neighbours, n)),
            offsets, current_decay, voltage_decay, threshold, window, reset, through_lateral,
            coding_gradient if k == 0 else nothing,
            grad_strength if k == 0 else below.reshape(steps * samples, n_in),
            _floats(gradients[k, 0], (n, n_in)),
            grad_branch_bias,
            grad_bias,
            grad_lateral,
        )  # fmt: skip
        grad = below


for _pass in (
    _fill, _copy, _add, _add_product, _add_four_products, _add_four_shifted, _add_shifted, _maxout_first, _maxout_next,
    _current, _membrane, _fire, _membrane_gradient, _current_gradient, _branch_gradient,
):  # fmt: skip
    globals()[_pass.__name__] = disjoint(_pass)
for _function in (
    _spread, _gather, _product, _aligned, _forward, _backward, _layer_forward, _layer_backward, _floats, _bytes,
    _columns,
):  # fmt: skip
    globals()[_function.__name__] = njit(error_model="numpy")(_function)


@cache
def forward_kernel() -> Callable[..., None]:
    """The compiled forward scan."""
    return compiled(_forward.py_func, _FORWARD)  # type: ignore[attr-defined]


@cache
def backward_kernel() -> Callable[..., None]:
    """The compiled gradient of the scan."""
    return compiled(_backward.py_func, _BACKWARD)  # type: ignore[attr-defined]


@cache
def spread_kernel() -> Callable[..., None]:
    """The compiled spreading: arguments weight, branch, spread (filled)."""
    return compiled(_spread.py_func, _SPREAD)  # type: ignore[attr-defined]


@cache
def gather_kernel() -> Callable[..., None]:
    """The compiled gathering: arguments gathered (filled), branch, spread."""
    return compiled(_gather.py_func, _SPREAD)  # type: ignore[attr-defined]


@cache
def network_forward_kernel() -> Callable[..., None]:
    """The compiled layers."""
    return compiled(_network_forward, _NETWORK_FORWARD)


@cache
def network_backward_kernel() -> Callable[..., None]:
    """The compiled gradient of the layers."""
    return compiled(_network_backward, _NETWORK_BACKWARD)
