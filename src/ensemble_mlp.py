"""An ensemble of ReLU networks as one differentiable operation, with its backward written by hand.

Eager autograd spends more time on bookkeeping than on the products of networks this small (batch 100, width 256). Here
all E networks go through one batched product per layer, and the whole network is one node of the graph:

    h_0 = x,   h_k = relu(h_{k-1} W_k + b_k) for k < L,   y = h_{L-1} W_L + b_L
    dW_k = h_{k-1}^T g_k,   db_k = sum_B g_k,   g_{k-1} = (g_k W_k^T) * 1[h_{k-1} > 0]

`tests/test_ensemble_mlp.py` holds it against ``torch.nn.Linear`` and autograd.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import torch
from torch import Tensor, nn

from src.streams import Streams


class _EnsembleMLPFunction(torch.autograd.Function):
    """``apply(final_relu, first, second, W_1, b_1, ..., W_L, b_L)`` on ``cat([first, second], -1)``, or ``first``."""

    @staticmethod
    def forward(ctx: Any, final_relu: bool, first: Tensor, second: Tensor | None, *parameters: Tensor) -> Tensor:
        x = first if second is None else torch.cat([first, second], dim=-1)
        ensemble = parameters[0].shape[0]
        hidden: list[Tensor] = [x.expand(ensemble, *x.shape) if x.dim() == 2 else x]
        layers = len(parameters) // 2
        for k in range(layers):
            y = torch.baddbmm(parameters[2 * k + 1], hidden[-1], parameters[2 * k])
            hidden.append(y.relu_() if final_relu or k < layers - 1 else y)
        ctx.save_for_backward(*(hidden if final_relu else hidden[:-1]), *parameters[0::2])
        ctx.layers, ctx.final_relu = layers, final_relu
        ctx.split = None if second is None else first.shape[-1]
        ctx.shared_input = x.dim() == 2
        return hidden[-1]

    @staticmethod
    def backward(ctx: Any, *gradients: Tensor) -> tuple[Tensor | None, ...]:
        (g,) = gradients
        saved = ctx.saved_tensors
        hidden, weights = saved[: -ctx.layers], saved[-ctx.layers :]
        need = ctx.needs_input_grad[1:]
        if ctx.final_relu:
            g = torch.ops.aten.threshold_backward(g, hidden[-1], 0)
        parameter_gradients: list[Tensor | None] = [None] * (2 * ctx.layers)
        first_gradient = second_gradient = None
        for k in reversed(range(ctx.layers)):
            if need[2 + 2 * k]:
                parameter_gradients[2 * k] = torch.bmm(hidden[k].transpose(1, 2), g)
                parameter_gradients[2 * k + 1] = g.sum(dim=1, keepdim=True)
            if k > 0:
                g = torch.ops.aten.threshold_backward(torch.bmm(g, weights[k].transpose(1, 2)), hidden[k], 0)
        if need[0]:
            first_gradient = _input_gradient(g, weights[0][:, : ctx.split], ctx.shared_input)
        if need[1]:
            second_gradient = _input_gradient(g, weights[0][:, ctx.split :], ctx.shared_input)
        return None, first_gradient, second_gradient, *parameter_gradients


def _input_gradient(g: Tensor, weight: Tensor, shared_input: bool) -> Tensor:
    gradient = torch.bmm(g, weight.transpose(1, 2))
    if not shared_input:
        return gradient
    return gradient[0] if gradient.shape[0] == 1 else gradient.sum(dim=0)


class EnsembleMLP(nn.Module):
    """E independent ReLU networks ``input_size -> hidden_sizes -> output_size``.

    Weights are stored as ``[E, in, out]``, biases as ``[E, 1, out]``, both drawn from PyTorch's default Linear
    distribution U(-1/sqrt(in), 1/sqrt(in)), each member and parameter from its own stream.

    Args:
        sizes: layer sizes, input first.
        ensemble: number E of networks.
        streams: the run's random streams.
        name: prefix of the initialisation streams.
        final_relu: the last layer has a ReLU too (a trunk for heads to share).
    """

    def __init__(
        self, sizes: Sequence[int], ensemble: int, streams: Streams, name: str, *, final_relu: bool = False
    ) -> None:
        super().__init__()
        self.weights = nn.ParameterList()
        self.biases = nn.ParameterList()
        for k, (fan_in, fan_out) in enumerate(pairwise(sizes)):
            weight, bias = torch.empty(ensemble, fan_in, fan_out), torch.empty(ensemble, 1, fan_out)
            bound = fan_in**-0.5
            for e in range(ensemble):
                weight[e].uniform_(-bound, bound, generator=streams.torch("initialisation", f"{name}.{e}.{k}.weight"))
                bias[e].uniform_(-bound, bound, generator=streams.torch("initialisation", f"{name}.{e}.{k}.bias"))
            self.weights.append(nn.Parameter(weight))
            self.biases.append(nn.Parameter(bias))
        self.final_relu = final_relu

    def forward(
        self, first: Tensor, second: Tensor | None = None, *, members: int | None = None, frozen: bool = False
    ) -> Tensor:
        """Outputs ``[E, B, out]`` for inputs ``[B, in]`` (or ``[E, B, in]``), given whole or in two parts.

        Args:
            first: input, or its first columns.
            second: the other columns.
            members: evaluate only the first this many networks.
            frozen: gradients flow to the input only, as in an actor's update.
        """
        parameters: list[Tensor] = []
        for parameter in (p for pair in zip(self.weights, self.biases) for p in pair):
            part = parameter if members is None else parameter[:members]
            parameters.append(part.detach() if frozen else part)
        result: Tensor = _EnsembleMLPFunction.apply(self.final_relu, first, second, *parameters)
        return result
