"""The arguments of kernels, as NumPy records with named fields: sizes, constants, and addresses (0 for none).

A kernel reads ``layer["weight"]``. Addresses of parameters and gradients are found once, when a learner is built.
"""

from __future__ import annotations

import numpy as np
from numba import from_dtype

from src.actors.lif import LIFConstants


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
        "grad_weight",
        "grad_bias",
        "grad_lateral",
    )
)

#: What a pass leaves of a spiking layer; the last two of the last minibatch, where it is saved for its gradient.
SPIKING_TRACE = np.dtype(
    _integers(
        "spikes",  # [G, T, B, n]
        "branch_weights",  # of this pass, [d*n, inputs]; for d = 1 the weight
        "potentials",  # [T, B, n]
        "argmax_branch",  # the branch of the largest current, [T, B, n], int8
    )
)

#: Constants of the LIF neurons.
NEURON_CONSTANTS = np.dtype([(name, np.float32) for name in LIFConstants._fields])

#: A pass of a spiking network over G minibatches of B samples, and the gradient of its last minibatch.
SPIKING_PASS = np.dtype(
    _integers(
        "sgemm",  # the product
        "groups",  # G
        "steps",  # T
        "samples",  # B
        "actions",  # M
        "saved",  # 1 where a gradient may follow, else 0
        "input_spikes",  # [G, T, B, inputs]
        "rates",  # of the output population, [G*B, M*P]
        "decoder",  # [M, P]
        "grad_raw",  # gradient w.r.t. the raw action, [B, M]
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
        "grad_weight",
        "grad_bias",
    )
)

#: As Numba sees arrays of them.
SPIKING_LAYERS = from_dtype(SPIKING_LAYER)[::1]
SPIKING_TRACES = from_dtype(SPIKING_TRACE)[::1]
CONSTANTS_ARRAY = from_dtype(NEURON_CONSTANTS)[::1]
SPIKING_PASSES = from_dtype(SPIKING_PASS)[::1]
MLP_LAYERS = from_dtype(MLP_LAYER)[::1]
