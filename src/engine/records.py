"""The arguments of kernels, as NumPy records with named fields: sizes, constants, and addresses (0 for none).

A kernel reads ``layer["weight"]``. Addresses of parameters and gradients are found once, when a learner is built.
"""

from __future__ import annotations

import numpy as np
from numba import from_dtype


def _integers(*names: str) -> list[tuple[str, type]]:
    return [(name, np.int64) for name in names]


#: A spiking layer: its sizes, its parameters, and where their gradients go.
SPIKING_LAYER = np.dtype(
    _integers(
        "inputs",
        "neurons",  # n
        "branches",  # d
        "neighbours",  # K
        "bias_per_branch",  # 0 or 1
        "weight",  # [n, inputs]
        "bias",  # [n], or [d, n] of the branches
        "lateral",  # [K, n]
        "branch",  # of each synapse, [n, inputs], int8
        "branch_weights",  # for d = 1 the weight, else 0
        "grad_weight",
        "grad_bias",
        "grad_lateral",
    )
)

#: What a pass leaves of a spiking layer.
SPIKING_TRACE = np.dtype(
    _integers(
        "spikes",  # [G, T, B, n]
        "potentials",  # [saved, T, B, n]
        "argmax_branch",  # the argmax_branch branch, [saved, T, B, n], int8
        "branch_weights",  # of this pass, [d*n, inputs]
    )
)

#: Constants of the LIF neurons (:class:`src.actors.lif.LIFConstants`).
NEURON_CONSTANTS = np.dtype(
    [
        (name, np.float32)
        for name in ("current_decay", "voltage_decay", "threshold", "window", "reset", "lateral_gradient")
    ]
)

#: A pass of a spiking network over G minibatches of B samples; the last ``saved`` save what their gradient needs.
SPIKING_PASS = np.dtype(
    _integers(
        "sgemm",  # the product
        "groups",  # G
        "steps",  # T
        "samples",  # B
        "saved",
        "input_spikes",  # [G, T, B, inputs]
        "rates",  # of the output population, [G*B, M*P]
    )
)

#: The gradient of such a pass, of its last minibatch.
SPIKING_GRADIENT = np.dtype(
    _integers(
        "sgemm",
        "steps",
        "samples",
        "actions",  # M
        "input_spikes",  # [T, B, inputs]
        "grad_raw",  # gradient w.r.t. the raw action, [B, M]
        "decoder",  # [M, P]
        "grad_strength",  # gradient w.r.t. the stimulation strength, [B, inputs]; 0: not wanted
    )
)

#: A layer of an ensemble of E multilayer perceptrons.
MLP_LAYER = np.dtype(
    _integers(
        "inputs",
        "outputs",
        "weight",  # [E, inputs, outputs]
        "bias",  # [E, 1, outputs]
        "grad_weight",  # 0: no gradients are wanted
        "grad_bias",
    )
)

#: As Numba sees arrays of them.
SPIKING_LAYERS = from_dtype(SPIKING_LAYER)[::1]
SPIKING_TRACES = from_dtype(SPIKING_TRACE)[::1]
CONSTANTS_ARRAY = from_dtype(NEURON_CONSTANTS)[::1]
SPIKING_PASSES = from_dtype(SPIKING_PASS)[::1]
SPIKING_GRADIENTS = from_dtype(SPIKING_GRADIENT)[::1]
MLP_LAYERS = from_dtype(MLP_LAYER)[::1]
