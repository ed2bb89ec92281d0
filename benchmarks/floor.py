"""The floor of an update: the matrix products that it can't avoid, and nothing else, by the best BLAS of the machine.

Shapes are those of the networks, forward and backward, with every operand allocated beforehand:

    y = x W          [B, in] x [in, out]      forward
    dW = x^T g       [in, B] x [B, out]       gradient of the weights
    dx = g W^T       [B, out] x [out, in]     gradient of the input, where something below learns

A spiking layer has T*B rows and, with dendrites, d*n columns. The first layer's input gradient needs only B rows,
because both spike codings are linear in time for the gradient.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import torch
from numba import int64, void
from threadpoolctl import threadpool_limits
from torch import Tensor

from src.config.schema import ExperimentConfig, SACConfig, SpikingActorConfig
from src.engine import blas
from src.engine.jit import kernel
from src.engine.primitives import multiply
from src.engine.td3 import target_groups


def one_thread() -> threadpool_limits:
    """A context in which OpenBLAS computes on one thread, as in a run, whatever the environment says.

    It reads its variable (``OPENBLAS_NUM_THREADS``) as it loads, and here it may be loaded already, or is loaded now.
    (PyTorch's MKL goes by ``torch.set_num_threads``.)
    """
    blas.address("openblas")
    return threadpool_limits(limits=1, user_api="blas")


class Product(NamedTuple):
    """``out[m, n] = left[m, k] @ right[k, n]``."""

    left: Tensor
    right: Tensor
    out: Tensor

    @property
    def flops(self) -> int:
        """Floating-point operations."""
        return 2 * self.left.shape[0] * self.left.shape[1] * self.right.shape[1]


class _Layer:
    """Operands of one linear layer."""

    def __init__(self, rows: int, inputs: int, outputs: int, input_rows: int | None = None) -> None:
        self.x, self.w, self.g = torch.rand(rows, inputs), torch.rand(inputs, outputs), torch.rand(rows, outputs)
        self.y, self.dw, self.dx = torch.empty(rows, outputs), torch.empty(inputs, outputs), torch.empty(rows, inputs)
        self.input_rows = rows if input_rows is None else input_rows

    def forward(self) -> Product:
        return Product(self.x, self.w, self.y)

    def weight_gradient(self) -> Product:
        return Product(self.x.t(), self.g, self.dw)

    def input_gradient(self) -> Product:
        rows = self.input_rows
        return Product(self.g[:rows], self.w.t(), self.dx[:rows])


def _mlp(rows: int, sizes: Sequence[int]) -> list[_Layer]:
    return [_Layer(rows, i, o) for i, o in pairwise(sizes)]


def _actor(config: ExperimentConfig, observation_size: int, action_size: int, batch: int) -> tuple[list[_Layer], bool]:
    """Layers of the actor, and whether its input learns (the encoder's receptive fields)."""
    actor = config.actor
    if not isinstance(actor, SpikingActorConfig):
        return _mlp(batch, (observation_size, *actor.hidden_sizes, action_size)), False  # type: ignore[union-attr]
    rows, d = batch * actor.time_steps, actor.dendritic.branches
    sizes = (observation_size * config.encoder.population_size, *actor.hidden_sizes)
    layers = [_Layer(rows, i, d * o) for i, o in pairwise(sizes)]
    layers.append(_Layer(rows, sizes[-1], action_size * actor.output_population))
    layers[0].input_rows = batch
    return layers, config.encoder.learnable


def _all_forward(layers: list[_Layer]) -> list[Product]:
    return [layer.forward() for layer in layers]


def _all_backward(layers: list[_Layer], *, weights: bool, to_input: bool) -> list[Product]:
    products = []
    for index, layer in reversed(list(enumerate(layers))):
        if weights:
            products.append(layer.weight_gradient())
        if index > 0 or to_input:
            products.append(layer.input_gradient())
    return products


def products_of_a_burst(config: ExperimentConfig, observation_size: int, action_size: int) -> list[Product]:
    """The products of ``protocol.update_every`` updates, in their order; targets group by group, as the learners do."""
    batch, algo, count = config.algo.batch_size, config.algo, config.protocol.update_every
    groups = list(target_groups(0, count, getattr(algo, "policy_delay", 1)))
    sizes = (observation_size + action_size, *algo.critic_hidden_sizes, 1)
    log_std_sizes: tuple[int, ...] = ()
    if isinstance(algo, SACConfig):
        shared = algo.log_std_network == "shared"
        hidden = (algo.critic_hidden_sizes[-1],) if shared else (observation_size, *algo.log_std_hidden_sizes)
        log_std_sizes = (*hidden, action_size)

    def targets(rows: int) -> list[Product]:
        networks = [_actor(config, observation_size, action_size, rows)[0], _mlp(rows, log_std_sizes)]
        return [p for layers in (*networks, _mlp(rows, sizes), _mlp(rows, sizes)) for p in _all_forward(layers)]

    target_step = {length: targets(length * batch) for length in {len(group) for group in groups}}
    critics = [_mlp(batch, sizes) for _ in range(2)]
    actor, encoder_learns = _actor(config, observation_size, action_size, batch)
    log_std = _mlp(batch, log_std_sizes)
    critic_step: list[Product] = []
    for network in critics:
        critic_step += [*_all_forward(network), *_all_backward(network, weights=True, to_input=False)]
    actor_step = [*_all_forward(actor), *_all_forward(log_std)]
    for network in critics if isinstance(algo, SACConfig) else critics[:1]:
        actor_step += _all_forward(network)
        below = _all_backward(network, weights=False, to_input=True)
        first = network[0]  # of the first layer only the action's columns
        below[-1] = Product(first.g, first.w[observation_size:].t(), first.dx[:, :action_size].contiguous())
        actor_step += below
    actor_step += _all_backward(actor, weights=True, to_input=encoder_learns)
    actor_step += _all_backward(log_std, weights=True, to_input=False)
    burst: list[Product] = []
    for group in groups:
        burst += target_step[len(group)]
        for index in group:
            burst += critic_step + (actor_step if index % getattr(algo, "policy_delay", 1) == 0 else [])
    return burst


class Floor:
    """Products to be run by a BLAS library, called as the engine calls it: one after the other, nothing between them.

    Args:
        products: they are kept, their operands stay where they are.
    """

    def __init__(self, products: list[Product]) -> None:
        self.flops = sum(product.flops for product in products)
        self._products = products
        self._table = np.array([_call(product) for product in products], np.int64)

    def run(self, library: str) -> None:
        """Compute all of them once by the library ``mkl`` or ``openblas``."""
        address = blas.address(library)
        assert address is not None
        _multiply_all(address, self._table)

    def best_library(self) -> str:
        """The fastest library of this machine, by the best of three runs each."""

        def fastest(library: str) -> float:
            times = []
            for _ in range(3):
                started = time.perf_counter()
                self.run(library)
                times.append(time.perf_counter() - started)
            return min(times)

        return min((name for name in ("mkl", "openblas") if blas.address(name) is not None), key=fastest)


def _call(product: Product) -> tuple[int, ...]:
    """n, m, k, and of each operand its address and row length; of a factor also whether it is stored transposed."""
    left, right, out = product
    (n, k), m = left.shape, right.shape[1]
    return n, m, k, *_factor(left), *_factor(right), out.data_ptr(), max(out.stride(0), m)


def _factor(matrix: Tensor) -> tuple[int, int, int]:
    transposed = matrix.stride(1) != 1 and matrix.stride(0) == 1
    length = max(matrix.stride(1), matrix.shape[0]) if transposed else max(matrix.stride(0), matrix.shape[1])
    return matrix.data_ptr(), length, int(transposed)


@kernel(void(int64, int64[:, ::1]))
def _multiply_all(sgemm, table):  # type: ignore[no-untyped-def]
    for row in table:
        n, m, k, a, lda, a_transposed, b, ldb, b_transposed, c, ldc = (
            row[0], row[1], row[2], row[3], row[4], row[5], row[6], row[7], row[8], row[9], row[10],
        )  # fmt: skip
        multiply(sgemm, n, m, k, a, lda, a_transposed > 0, b, ldb, b_transposed > 0, c, ldc, np.float32(0))
