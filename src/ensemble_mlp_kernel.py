"""The ensemble of ReLU networks on the CPU: products from BLAS, the passes between them in Numba, in one call.

The equations are those of :mod:`src.ensemble_mlp`. A bias and its ReLU are added to a product, and a gradient is masked
and summed over the batch, while it is still in the cache. Arrays come as addresses, since their number varies; all are
float32 and contiguous. ``sizes`` are the layer sizes, input first, ``E`` the networks, ``B`` the batch:

    parameters   W_1, b_1, ..., W_L, b_L: [E, sizes[k-1], sizes[k]] and [E, 1, sizes[k]]; ``gradients`` likewise
    hidden[k]    [E, B, sizes[k]]; hidden[0] is the input, [B, sizes[0]], one for all networks
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
from numba import carray, float32, int64, njit, void

from src.actors.kernels import compiled, floats_at
from src.blas import call_sgemm

ZERO = np.float32(0)
_ADDRESSES = int64[::1]
_FORWARD = void(int64, int64, int64, _ADDRESSES, _ADDRESSES, _ADDRESSES, int64)
_BACKWARD = void(int64, int64, int64, _ADDRESSES, _ADDRESSES, _ADDRESSES, int64, int64, _ADDRESSES, int64, int64, int64)
_REGRESS = void(
    int64, int64, int64, _ADDRESSES, _ADDRESSES, int64, _ADDRESSES, float32[::1], float32[:, ::1], float32[::1]
)  # fmt: skip
_DESCEND = void(int64, int64, int64, _ADDRESSES, _ADDRESSES, int64, float32, float32[:, ::1], int64, int64, int64)
FLOAT_BYTES = 4
LINE = 64  # bytes of a cache line, at which every buffer begins


@njit(error_model="numpy")
def _product(gemm, n, m, k, a, lda, a_transposed, b, ldb, b_transposed, c, ldc, accumulate):  # type: ignore[no-untyped-def]
    """``C[n, m] (+)= op(A)[n, k] op(B)[k, m]``, row by row: Fortran's ``C^T = op(B)^T op(A)^T``."""
    sizes = np.array([m, n, k, ldb, lda, ldc], np.int64)
    factors = np.array([1, accumulate], np.float32)
    flags = np.array([ord("T") if b_transposed else ord("N"), ord("T") if a_transposed else ord("N")], np.uint8)
    call_sgemm(gemm, flags, sizes, factors, b, a, c)


@njit(error_model="numpy")
def _add_bias(y, bias, relu):  # type: ignore[no-untyped-def]
    """``y = relu(y + bias)``, or without the ReLU; shapes ``[B, n]``, ``[n]``."""
    for r in range(y.shape[0]):
        row = y[r]
        if relu:
            for j in range(bias.shape[0]):
                value = row[j] + bias[j]
                row[j] = ZERO if value <= ZERO else value  # what is not a number stays so
        else:
            for j in range(bias.shape[0]):
                row[j] = row[j] + bias[j]


@njit(error_model="numpy")
def _mask(target, g, h):  # type: ignore[no-untyped-def]
    """``target = g * 1[h > 0]``; shapes ``[B, n]``; the target may be g."""
    for r in range(g.shape[0]):
        row, source, active = target[r], g[r], h[r]
        for j in range(row.shape[0]):
            value = source[j]  # loaded unconditionally, or the loop is not SIMD
            row[j] = ZERO if active[j] <= ZERO else value


@njit(error_model="numpy")
def _sum_rows(g, total):  # type: ignore[no-untyped-def]
    """``total = sum over B of g``; shapes ``[B, n]``, ``[n]``."""
    for j in range(total.shape[0]):
        total[j] = ZERO
    for r in range(g.shape[0]):
        row = g[r]
        for j in range(total.shape[0]):
            total[j] = total[j] + row[j]


@njit(error_model="numpy")
def _next_line(address):  # type: ignore[no-untyped-def]
    """The first address from there on that is a multiple of 64: a product's bits may hang on its alignment."""
    return (address + LINE - 1) // LINE * LINE


@njit(error_model="numpy")
def _keep(memory):  # type: ignore[no-untyped-def]
    """Numba frees an array after its last mention: those that are used by address are to be mentioned after that."""
    return memory.shape[0]


@njit(error_model="numpy")
def _forward(gemm, E, B, sizes, parameters, hidden, final_relu):  # type: ignore[no-untyped-def]
    """Fill ``hidden[1:]``, the last of which is the output; those between that are 0 are not kept."""
    layers = sizes.shape[0] - 1
    room = _next_line(B * sizes.max() * FLOAT_BYTES) if hidden[1:layers].sum() == 0 else 0
    scratch = np.empty(2 * room // FLOAT_BYTES + LINE, np.float32)
    first = _next_line(int64(scratch.ctypes.data))
    for e in range(E):
        x = hidden[0]
        for k in range(layers):
            n_in, n_out = sizes[k], sizes[k + 1]
            weight = parameters[2 * k] + e * n_in * n_out * FLOAT_BYTES
            kept = hidden[k + 1] + e * B * n_out * FLOAT_BYTES
            y = kept if hidden[k + 1] > 0 else first + k % 2 * room
            _product(gemm, B, n_out, n_in, x, n_in, False, weight, n_out, False, y, n_out, ZERO)
            bias = carray(floats_at(parameters[2 * k + 1] + e * n_out * FLOAT_BYTES), (n_out,))
            _add_bias(carray(floats_at(y), (B, n_out)), bias, final_relu or k < layers - 1)
            x = y
    _keep(scratch)


@njit(error_model="numpy")
def _backward(  # type: ignore[no-untyped-def]
    gemm, E, B, sizes, parameters, hidden, output_gradient, final_relu, gradients, input_gradient, input_start,
    input_stop,
):  # fmt: skip
    """From the output's gradient ``[E, B, sizes[L]]`` to those of the parameters and of some columns of the input.

    Empty ``gradients`` skip those of the parameters, an ``input_gradient`` of 0 skips the input's: else it is
    ``[B, input_stop - input_start]``, summed over the networks.
    """
    layers = sizes.shape[0] - 1
    room = _next_line(B * sizes[1:].max() * FLOAT_BYTES)
    scratch = np.empty(2 * room // FLOAT_BYTES + LINE, np.float32)
    first = _next_line(int64(scratch.ctypes.data))
    for e in range(E):
        source = output_gradient + e * B * sizes[layers] * FLOAT_BYTES
        for k in range(layers - 1, -1, -1):
            n_in, n_out = sizes[k], sizes[k + 1]
            x = hidden[k] + (e * B * n_in * FLOAT_BYTES if k > 0 else 0)
            weight = parameters[2 * k] + e * n_in * n_out * FLOAT_BYTES
            address = source
            if final_relu or k < layers - 1:
                address = first + k % 2 * room
                h = carray(floats_at(hidden[k + 1] + e * B * n_out * FLOAT_BYTES), (B, n_out))
                _mask(carray(floats_at(address), (B, n_out)), carray(floats_at(source), (B, n_out)), h)
            if gradients.shape[0] > 0:
                bias_gradient = carray(floats_at(gradients[2 * k + 1] + e * n_out * FLOAT_BYTES), (n_out,))
                _sum_rows(carray(floats_at(address), (B, n_out)), bias_gradient)
                weight_gradient = gradients[2 * k] + e * n_in * n_out * FLOAT_BYTES
                _product(gemm, n_in, n_out, B, x, n_in, True, address, n_out, False, weight_gradient, n_out, ZERO)
            if k > 0:
                source = first + (k - 1) % 2 * room
                _product(gemm, B, n_in, n_out, address, n_out, False, weight, n_out, True, source, n_in, ZERO)
            elif input_gradient > 0:
                columns = input_stop - input_start
                rows = weight + input_start * n_out * FLOAT_BYTES
                more = np.float32(e > 0)
                _product(
                    gemm, B, columns, n_out, address, n_out, False, rows, n_out, True, input_gradient, columns, more
                )  # fmt: skip
    _keep(scratch)


@njit(error_model="numpy")
def _places(E, B, sizes, x, outputs, memory):  # type: ignore[no-untyped-def]
    """``hidden`` for networks with one output each, the layers between in ``memory``; and where that has room left."""
    layers = sizes.shape[0] - 1
    hidden, free = np.empty(layers + 1, np.int64), _next_line(int64(memory.ctypes.data))
    hidden[0], hidden[layers] = x, int64(outputs.ctypes.data)
    for k in range(1, layers):
        hidden[k] = free
        free = _next_line(free + E * B * sizes[k] * FLOAT_BYTES)
    return hidden, free


@njit(error_model="numpy")
def _floats_needed(E, B, sizes):  # type: ignore[no-untyped-def]
    """Floats for all that :func:`_places` lays out, each part at a line's start."""
    return E * B * sizes[1:].sum() + (sizes.shape[0] + 1) * (LINE // FLOAT_BYTES)


def _regress(gemm, E, B, sizes, parameters, x, gradients, target, outputs, loss):  # type: ignore[no-untyped-def]
    """Forward, ``loss[0] = sum over E of mean over B of (y - target)^2``, and its gradient; one output per network."""
    memory = np.empty(_floats_needed(E, B, sizes), np.float32)
    hidden, address = _places(E, B, sizes, x, outputs, memory)
    _forward(gemm, E, B, sizes, parameters, hidden, 0)
    g = carray(floats_at(address), (E, B))
    total = 0.0
    for e in range(E):
        for b in range(B):
            error = outputs[e, b] - target[b]
            total += error * error
            g[e, b] = error * np.float32(2.0 / B)
    loss[0] = total / B
    _backward(gemm, E, B, sizes, parameters, hidden, address, 0, gradients, 0, 0, 0)
    _keep(memory)


def _descend(gemm, E, B, sizes, parameters, x, scale, outputs, input_gradient, start, stop):  # type: ignore[no-untyped-def]
    """Forward, and the gradient of ``scale * sum over B of min over E of y`` to some columns of the input.

    One output per network; where networks tie, each has its share of the gradient.
    """
    memory = np.empty(_floats_needed(E, B, sizes), np.float32)
    hidden, address = _places(E, B, sizes, x, outputs, memory)
    _forward(gemm, E, B, sizes, parameters, hidden, 0)
    g = carray(floats_at(address), (E, B))
    for b in range(B):
        smallest, ties = outputs[0, b], 1
        for e in range(1, E):
            if outputs[e, b] < smallest or outputs[e, b] != outputs[e, b]:  # not a number: the smallest is none either
                smallest, ties = outputs[e, b], 1
            elif outputs[e, b] == smallest:
                ties += 1
        for e in range(E):
            share = scale / np.float32(ties) if smallest == smallest else smallest
            g[e, b] = ZERO if outputs[e, b] > smallest else share
    _backward(gemm, E, B, sizes, parameters, hidden, address, 0, np.empty(0, np.int64), input_gradient, start, stop)
    _keep(memory)


@cache
def forward_kernel() -> Callable[..., None]:
    """The compiled networks."""
    return compiled(_forward.py_func, _FORWARD)


@cache
def backward_kernel() -> Callable[..., None]:
    """The compiled gradient."""
    return compiled(_backward.py_func, _BACKWARD)


@cache
def regress_kernel() -> Callable[..., None]:
    """The compiled regression: both of them around a squared error."""
    return compiled(_regress, _REGRESS)


@cache
def descend_kernel() -> Callable[..., None]:
    """The compiled gradient of the smallest output to the input."""
    return compiled(_descend, _DESCEND)
