"""A whole spiking network in one call, each direction: branch weights, products, scans, firing rates.

The currents and their gradient, the largest arrays, live inside the call only. Arguments are records of
:mod:`src.engine.records`; the equations are those of :mod:`src.actors`.
"""

from __future__ import annotations

import numpy as np
from numba import float32, int64, void

from src.engine.jit import inner, kernel
from src.engine.lif import ZERO, add, copy, fill, scan, scan_gradient
from src.engine.primitives import aligned, bytes_, floats, product
from src.engine.records import CONSTANTS_ARRAY, SPIKING_LAYERS, SPIKING_PASSES, SPIKING_TRACES


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


@inner
def _layer_forward(this, x, layer, trace, constants, offsets):  # type: ignore[no-untyped-def]
    """Spikes ``[G*T*B, n]`` of the input ``[G*T*B, inputs]``, and what the last minibatch saves for its gradient."""
    groups, steps, samples, saved = this["groups"], this["steps"], this["samples"], this["saved"]
    n, inputs, branches = layer["neurons"], layer["inputs"], layer["branches"]
    by_branch, count = layer["bias_per_branch"], groups * steps * samples
    spikes = floats(trace["spikes"], (groups, steps, samples, n))
    potentials = floats(trace["potentials"], (saved * steps, samples, n))
    argmax_branch = bytes_(trace["argmax_branch"], (saved * steps if branches > 1 else 0, samples, n))
    branch_bias = floats(layer["bias"], (branches if by_branch else 0, n))
    bias = np.zeros(n, np.float32) if by_branch else floats(layer["bias"], (n,))
    lateral = floats(layer["lateral"], (layer["neighbours"], n))
    weights = floats(trace["branch_weights"], (branches * n, inputs))
    if branches == 1:  # a spike takes the place of its current
        currents = spikes.reshape(count, n)
    else:
        currents = aligned(count * branches * n).reshape(count, branches * n)
        weight, branch = floats(layer["weight"], (n, inputs)), bytes_(layer["branch"], (n, inputs))
        expand_branches(weight, branch, weights.reshape(branches, n, inputs))
    product(this["sgemm"], x, False, weights, True, currents)
    by_group = currents.reshape(groups, steps, samples, branches, n)
    for g in range(groups):
        saves = saved > 0 and g == groups - 1
        scan(
            by_group[g], branch_bias, bias, lateral, offsets, constants, spikes[g], potentials, argmax_branch, saves
        )  # fmt: skip
    return spikes.reshape(count, n)


@kernel(void(SPIKING_PASSES, SPIKING_LAYERS, SPIKING_TRACES, CONSTANTS_ARRAY, int64[::1]))
def network_forward(passes, layers, traces, all_constants, offsets):  # type: ignore[no-untyped-def]
    """Layer after layer, and the firing rates of the last; of one pass, and of neurons of one kind.

    ``offsets`` are the index distances of the K neighbours.
    """
    this, constants = passes[0], all_constants[0]
    groups, steps, samples = this["groups"], this["steps"], this["samples"]
    x = floats(this["input_spikes"], (groups * steps * samples, layers[0]["inputs"]))
    for k in range(layers.shape[0]):
        x = _layer_forward(this, x, layers[k], traces[k], constants, offsets)
    n = x.shape[1]
    by_step, rates = x.reshape(groups, steps, samples, n), floats(this["rates"], (groups * samples, n))
    for g in range(groups):
        for b in range(samples):
            rate = rates[g * samples + b]
            fill(rate, ZERO)
            for t in range(steps):
                add(rate, by_step[g, t, b])
            for j in range(n):
                rate[j] = rate[j] / np.float32(steps)


@inner
def _layer_backward(this, grad, x, layer, trace, constants, offsets, coding_gradient, grad_input):  # type: ignore[no-untyped-def]
    """Given the gradient w.r.t. the spikes ``[T, B, n]`` (overwritten), fill the parameters'.

    And the input's, ``[T*B, inputs]``, or with a ``coding_gradient`` ``[1, T]`` that of the strength ``[B, inputs]``
    that x encodes; neither where ``grad_input`` is empty.
    """
    (steps, samples, n), sgemm = grad.shape, this["sgemm"]
    inputs, branches, neighbours = layer["inputs"], layer["branches"], layer["neighbours"]
    by_branch, width = layer["bias_per_branch"], layer["branches"] * layer["neurons"]
    grad_branch_bias = floats(layer["grad_bias"], (branches if by_branch else 0, n))
    grad_bias = np.empty(n, np.float32) if by_branch else floats(layer["grad_bias"], (n,))
    grad_lateral = floats(layer["grad_lateral"], (neighbours, n))
    grad_weight = floats(layer["grad_weight"], (n, inputs))
    fill(grad_bias, ZERO)
    for m in range(grad_branch_bias.shape[0]):
        fill(grad_branch_bias[m], ZERO)
    for neighbour in range(neighbours):
        fill(grad_lateral[neighbour], ZERO)
    if branches == 1:  # in place of that to the spikes
        grad_currents = grad.reshape(steps * samples, n)
    else:
        grad_currents = aligned(steps * samples * width).reshape(steps * samples, width)
    scan_gradient(
        grad,
        floats(trace["spikes"], (this["groups"], steps, samples, n))[-1],
        floats(trace["potentials"], (steps, samples, n)),
        bytes_(trace["argmax_branch"], (steps if branches > 1 else 0, samples, n)),
        floats(layer["lateral"], (neighbours, n)),
        offsets, constants, grad_currents.reshape(steps, samples, branches, n), grad_branch_bias, grad_bias,
        grad_lateral,
    )  # fmt: skip
    if branches > 1:
        grad_branch_weights = aligned(width * inputs).reshape(width, inputs)
        product(sgemm, grad_currents, True, x, False, grad_branch_weights)
        branch = bytes_(layer["branch"], (n, inputs))
        collect_branches(grad_weight, branch, grad_branch_weights.reshape(branches, n, inputs))
    else:
        product(sgemm, grad_currents, True, x, False, grad_weight)
    weights = floats(trace["branch_weights"], (width, inputs))
    if coding_gradient.shape[0] > 0 and grad_input.shape[0] > 0:
        summed = aligned(samples * width).reshape(samples, width)
        by_step = grad_currents.reshape(steps, samples * width)
        product(sgemm, coding_gradient, False, by_step, False, summed.reshape(1, samples * width))
        product(sgemm, summed, False, weights, False, grad_input)
    elif grad_input.shape[0] > 0:
        product(sgemm, grad_currents, False, weights, False, grad_input)


@kernel(void(SPIKING_PASSES, SPIKING_LAYERS, SPIKING_TRACES, CONSTANTS_ARRAY, int64[::1], float32[:, ::1]))
def network_backward(passes, layers, traces, all_constants, offsets, coding_gradient):  # type: ignore[no-untyped-def]
    """Given the gradient w.r.t. the raw action of the last minibatch, fill those w.r.t. all layers' parameters and the
    stimulation strength.

    ``coding_gradient`` is ``d spike_tau / d A``, ``[1, T]``.
    """
    this, constants, last = passes[0], all_constants[0], layers.shape[0] - 1
    groups, steps, samples, actions = this["groups"], this["steps"], this["samples"], this["actions"]
    nothing, n = np.empty((0, 0), np.float32), layers[last]["neurons"]
    grad_raw = floats(this["grad_raw"], (samples, actions))
    decoder = floats(this["decoder"], (actions, n // actions))
    grad = aligned(steps * samples * n).reshape(steps, samples, n)
    for b in range(samples):
        for m in range(decoder.shape[0]):
            for p in range(decoder.shape[1]):
                grad[0, b, m * decoder.shape[1] + p] = grad_raw[b, m] * decoder[m, p] / np.float32(steps)
    for t in range(1, steps):
        copy(grad[t].reshape(samples * n), grad[0].reshape(samples * n))
    for k in range(last, 0, -1):
        inputs = layers[k]["inputs"]
        x = floats(traces[k - 1]["spikes"], (groups, steps * samples, inputs))[-1]
        below = aligned(steps * samples * inputs).reshape(steps, samples, inputs)
        grad_input = below.reshape(steps * samples, inputs)
        _layer_backward(this, grad, x, layers[k], traces[k], constants, offsets, nothing, grad_input)
        grad = below
    inputs = layers[0]["inputs"]
    x = floats(this["input_spikes"], (groups, steps * samples, inputs))[-1]
    grad_strength = floats(this["grad_strength"], (samples if this["grad_strength"] != 0 else 0, inputs))
    _layer_backward(this, grad, x, layers[0], traces[0], constants, offsets, coding_gradient, grad_strength)
