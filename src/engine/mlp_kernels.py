"""An ensemble of ReLU networks (:class:`src.actors.mlp.EnsembleMLP`) in one call, forward and backward by hand::

    h_0 = x,   h_k = relu(h_{k-1} W_k + b_k) for k < L,   y = h_{L-1} W_L + b_L
    dW_k = h_{k-1}^T g_k,   db_k = sum_B g_k,   g_{k-1} = (g_k W_k^T) * 1[h_{k-1} > 0]

A bias and its ReLU are added to a product, and a gradient is masked and summed over the batch, while it is still in the
cache. ``layers`` are records of :data:`src.engine.records.MLP_LAYER`, E the networks, B the batch; arrays come as
addresses, 0 for none: ``hidden[k]`` of ``[E, B, n_k]``; ``hidden[0]`` of the input ``[B, n_0]``, one for all networks.
"""

from __future__ import annotations

import numpy as np
from numba import float32, int64, void

from src.engine.jit import inner, kernel
from src.engine.primitives import FLOAT, LINE, floats, keep_alive, multiply, next_line
from src.engine.records import MLP_LAYERS

ZERO = np.float32(0)


@inner
def _add_bias(y, bias, relu):  # type: ignore[no-untyped-def]
    """``y = relu(y + bias)``, or without the ReLU; shapes ``[B, n]``, ``[n]``."""
    for r in range(y.shape[0]):
        row = y[r]
        if relu:
            for j in range(bias.shape[0]):
                value = row[j] + bias[j]
                row[j] = ZERO if value <= ZERO else value  # NaN propagates
        else:
            for j in range(bias.shape[0]):
                row[j] = row[j] + bias[j]


@inner
def _mask(target, g, h):  # type: ignore[no-untyped-def]
    """``target = g * 1[h > 0]``; shapes ``[B, n]``; the target may be g."""
    for r in range(g.shape[0]):
        row, source, active = target[r], g[r], h[r]
        for j in range(row.shape[0]):
            value = source[j]  # loaded unconditionally, or the loop is not SIMD
            row[j] = ZERO if active[j] <= ZERO else value


@inner
def _sum_rows(g, total):  # type: ignore[no-untyped-def]
    """``total = sum over B of g``; shapes ``[B, n]``, ``[n]``."""
    for j in range(total.shape[0]):
        total[j] = ZERO
    for r in range(g.shape[0]):
        row = g[r]
        for j in range(total.shape[0]):
            total[j] = total[j] + row[j]


@inner
def _widest(layers):  # type: ignore[no-untyped-def]
    """The largest number of neurons of a layer, the input included."""
    widest = layers[0]["inputs"]
    for k in range(layers.shape[0]):
        widest = max(widest, layers[k]["outputs"])
    return widest


@inner
def _forward(sgemm, E, B, layers, hidden, final_relu):  # type: ignore[no-untyped-def]
    """Fill ``hidden[1:]``, the last of which is the output; those between that are 0 are not saved."""
    count = layers.shape[0]
    half_bytes = next_line(B * _widest(layers) * FLOAT) if hidden[1:count].sum() == 0 else 0
    scratch = np.empty(2 * half_bytes // FLOAT + LINE, np.float32)
    scratch_start = next_line(int64(scratch.ctypes.data))
    for e in range(E):
        x = hidden[0]
        for k in range(count):
            n_in, n_out = layers[k]["inputs"], layers[k]["outputs"]
            weight = layers[k]["weight"] + e * n_in * n_out * FLOAT
            saved = hidden[k + 1] + e * B * n_out * FLOAT
            y = saved if hidden[k + 1] > 0 else scratch_start + k % 2 * half_bytes
            multiply(sgemm, B, n_out, n_in, x, n_in, False, weight, n_out, False, y, n_out, ZERO)
            bias = floats(layers[k]["bias"] + e * n_out * FLOAT, (n_out,))
            _add_bias(floats(y, (B, n_out)), bias, final_relu or k < count - 1)
            x = y
    keep_alive(scratch)


@inner
def _backward(  # type: ignore[no-untyped-def]
    sgemm, E, B, layers, hidden, grad_outputs, final_relu, wants_parameters, grad_input, input_start, input_stop
):
    """Given the gradient w.r.t. the outputs ``[E, B, n_L]``, fill the parameters' and some columns of the input's.

    Where ``wants_parameters`` is 0 those are skipped; a ``grad_input`` of 0 skips the input's: else it is
    ``[B, input_stop - input_start]``, summed over the networks.
    """
    count = layers.shape[0]
    half_bytes = next_line(B * _widest(layers) * FLOAT)
    scratch = np.empty(2 * half_bytes // FLOAT + LINE, np.float32)
    scratch_start = next_line(int64(scratch.ctypes.data))
    for e in range(E):
        source = grad_outputs + e * B * layers[count - 1]["outputs"] * FLOAT
        for k in range(count - 1, -1, -1):
            n_in, n_out = layers[k]["inputs"], layers[k]["outputs"]
            x = hidden[k] + (e * B * n_in * FLOAT if k > 0 else 0)
            weight = layers[k]["weight"] + e * n_in * n_out * FLOAT
            address = source
            if final_relu or k < count - 1:
                address = scratch_start + k % 2 * half_bytes
                h = floats(hidden[k + 1] + e * B * n_out * FLOAT, (B, n_out))
                _mask(floats(address, (B, n_out)), floats(source, (B, n_out)), h)
            if wants_parameters:
                grad_bias = floats(layers[k]["grad_bias"] + e * n_out * FLOAT, (n_out,))
                _sum_rows(floats(address, (B, n_out)), grad_bias)
                grad_weight = layers[k]["grad_weight"] + e * n_in * n_out * FLOAT
                multiply(sgemm, n_in, n_out, B, x, n_in, True, address, n_out, False, grad_weight, n_out, ZERO)
            if k > 0:
                source = scratch_start + (k - 1) % 2 * half_bytes
                multiply(sgemm, B, n_in, n_out, address, n_out, False, weight, n_out, True, source, n_in, ZERO)
            elif grad_input > 0:
                columns = input_stop - input_start
                rows = weight + input_start * n_out * FLOAT
                more = np.float32(e > 0)
                multiply(
                    sgemm, B, columns, n_out, address, n_out, False, rows, n_out, True, grad_input, columns, more
                )  # fmt: skip
    keep_alive(scratch)


@inner
def _lay_out(E, B, layers, x, outputs):  # type: ignore[no-untyped-def]
    """``hidden`` for networks with one output each, ``[E, B]`` free numbers behind it, and the memory of both."""
    count, neurons = layers.shape[0], 0
    for k in range(count):
        neurons += layers[k]["outputs"]
    memory = np.empty(E * B * neurons + (count + 2) * (LINE // FLOAT), np.float32)
    hidden, free = np.empty(count + 1, np.int64), next_line(int64(memory.ctypes.data))
    hidden[0], hidden[count] = x, outputs
    for k in range(1, count):
        hidden[k] = free
        free = next_line(free + E * B * layers[k]["inputs"] * FLOAT)
    return hidden, free, memory


forward = kernel(void(*3 * (int64,), MLP_LAYERS, int64[::1], int64))(_forward)
backward = kernel(void(*3 * (int64,), MLP_LAYERS, int64[::1], *6 * (int64,)))(_backward)


@kernel(void(*3 * (int64,), MLP_LAYERS, *4 * (int64,)))
def squared_error_step(sgemm, E, B, layers, x, target, outputs, loss):  # type: ignore[no-untyped-def]
    """Forward, ``loss[0] = sum over E of mean over B of (y - target)^2``, and its gradient; one output per network.

    Addresses of ``[B, n_0]``, ``[B]``, ``[E, B]`` (filled) and ``[1]`` (filled).
    """
    hidden, free, memory = _lay_out(E, B, layers, x, outputs)
    _forward(sgemm, E, B, layers, hidden, 0)
    y, expected, g = floats(outputs, (E, B)), floats(target, (B,)), floats(free, (E, B))
    total = 0.0
    for e in range(E):
        for b in range(B):
            error = y[e, b] - expected[b]
            total += error * error
            g[e, b] = error * np.float32(2.0 / B)
    floats(loss, (1,))[0] = total / B
    _backward(sgemm, E, B, layers, hidden, free, 0, 1, 0, 0, 0)
    keep_alive(memory)


@kernel(void(*3 * (int64,), MLP_LAYERS, int64, float32, *4 * (int64,)))
def minimum_input_gradient(  # type: ignore[no-untyped-def]
    sgemm, E, B, layers, x, scale, outputs, grad_input, start, stop
):
    """Forward, and the gradient of ``scale * sum over B of min over E of y`` to some columns of the input.

    One output per network; where networks tie, each has its share of the gradient. Addresses of ``[B, n_0]``,
    ``[E, B]`` (filled) and ``[B, stop - start]`` (filled).
    """
    hidden, free, memory = _lay_out(E, B, layers, x, outputs)
    _forward(sgemm, E, B, layers, hidden, 0)
    y, g = floats(outputs, (E, B)), floats(free, (E, B))
    for b in range(B):
        smallest, ties = y[0, b], 1
        for e in range(1, E):
            if y[e, b] < smallest or y[e, b] != y[e, b]:  # NaN propagates
                smallest, ties = y[e, b], 1
            elif y[e, b] == smallest:
                ties += 1
        for e in range(E):
            share = scale / np.float32(ties) if smallest == smallest else smallest
            g[e, b] = ZERO if y[e, b] > smallest else share
    _backward(sgemm, E, B, layers, hidden, free, 0, 0, grad_input, start, stop)
    keep_alive(memory)
