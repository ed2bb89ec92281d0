"""An ensemble of ReLU networks with its backward written by hand.

Eager autograd spends more time on bookkeeping than on the products of networks this small (batch 100, width 256). Here
the whole ensemble of E networks is one call in each direction:

    h_0 = x,   h_k = relu(h_{k-1} W_k + b_k) for k < L,   y = h_{L-1} W_L + b_L
    dW_k = h_{k-1}^T g_k,   db_k = sum_B g_k,   g_{k-1} = (g_k W_k^T) * 1[h_{k-1} > 0]

For float32 on the CPU it is one call of a compiled kernel (:mod:`src.ensemble_mlp_kernel`); otherwise, and wherever
autograd records, one batched product per layer in PyTorch, which is the specification. `tests/test_ensemble_mlp.py`
holds both against ``torch.nn.Linear`` and autograd.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor, nn

from src.actors.kernels import as_array, takes_kernel
from src.blas import sgemm_address
from src.ensemble_mlp_kernel import backward_kernel, descend_kernel, forward_kernel, regress_kernel
from src.places import GradientOf, Places, destinations
from src.streams import Streams

#: From the gradient to the outputs ``[E, B, out]``, where those of the parameters belong, and whether the input's is
#: wanted, to that, ``[B, in]``, or None.
PullOutputs = Callable[[Tensor, GradientOf, bool], Tensor | None]


def ensemble_mlp(parameters: Sequence[Tensor], final_relu: bool, x: Tensor, places: Places) -> Tensor:
    """Outputs ``[E, B, out]`` of networks ``W_1, b_1, ..., W_L, b_L`` on ``[B, in]``.

    Where gradients are recorded, in PyTorch's operators: autograd works as ever.
    """
    if torch.is_grad_enabled() or not _takes_kernel(x, parameters[0]):
        return _forward(x, parameters, final_relu)[-1]
    return _fused_forward(x, places.once(_networks, parameters), final_relu, keep=False)[-1]


@torch.no_grad()
def ensemble_mlp_vjp(
    parameters: Sequence[Tensor], final_relu: bool, x: Tensor, places: Places, last: int | None = None
) -> tuple[Tensor, PullOutputs]:
    """:func:`ensemble_mlp` on ``[B, in]`` without autograd, and its vector-Jacobian product (as of ``torch.func.vjp``).

    The product is that of the last rows of x where ``last`` says how many. The second result takes the gradient to the
    outputs and fills those of the parameters that ``gradient_of`` holds, before any of them changes.
    """
    if _takes_kernel(x, parameters[0]):
        networks = places.once(_networks, parameters)
        hidden = _fused_forward(x, networks, final_relu, keep=True)
        kept = _last_rows(hidden, last)

        def pull(to_outputs: Tensor, gradient_of: GradientOf, to_input: bool) -> Tensor | None:
            to = places.once(_gradients, parameters, gradient_of)
            return _fused_pull(kept, networks, final_relu, to_outputs, to, to_input)

    else:
        hidden = _forward(x, parameters, final_relu)
        kept = _last_rows(hidden, last)

        def pull(to_outputs: Tensor, gradient_of: GradientOf, to_input: bool) -> Tensor | None:
            return _pull(kept, parameters, final_relu, to_outputs, destinations(parameters, gradient_of), to_input)

    return hidden[-1], pull


def _last_rows(hidden: Sequence[Tensor], last: int | None) -> Sequence[Tensor]:
    return hidden if last is None else [h[..., -last:, :].contiguous() for h in hidden]


def _forward(x: Tensor, parameters: Sequence[Tensor], final_relu: bool) -> list[Tensor]:
    """The input and the output of each layer."""
    weights, biases = parameters[0::2], parameters[1::2]
    hidden = [x.expand(weights[0].shape[0], *x.shape) if x.dim() == 2 else x]
    for k, (weight, bias) in enumerate(zip(weights, biases)):
        y = torch.baddbmm(bias, hidden[-1], weight)
        hidden.append(y.relu_() if final_relu or k < len(weights) - 1 else y)
    if x.dim() == 2:
        hidden[0] = x
    return hidden


@torch.no_grad()
def _pull(
    hidden: Sequence[Tensor],
    parameters: Sequence[Tensor],
    final_relu: bool,
    g: Tensor,
    gradients: Sequence[Tensor],
    to_input: bool,
) -> Tensor | None:
    """The gradients of :func:`_forward` on ``[B, in]``."""
    weights = parameters[0::2]
    for k in reversed(range(len(weights))):
        if final_relu or k < len(weights) - 1:
            g = torch.ops.aten.threshold_backward(g, hidden[k + 1], 0)
        x = hidden[0].expand(g.shape[0], *hidden[0].shape) if k == 0 else hidden[k]
        gradients[2 * k].copy_(torch.bmm(x.transpose(1, 2), g))
        gradients[2 * k + 1].copy_(g.sum(dim=1, keepdim=True))
        if k > 0 or to_input:
            g = torch.bmm(g, weights[k].transpose(1, 2))
    return g.sum(dim=0) if to_input else None


def _takes_kernel(x: Tensor, weight: Tensor) -> bool:
    return x.dim() == 2 and takes_kernel(x) and takes_kernel(weight)


def _addresses(tensors: Sequence[Tensor]) -> np.ndarray:
    return np.array([tensor.data_ptr() for tensor in tensors], np.int64)


class _Networks(NamedTuple):
    """The networks as the kernels take them."""

    ensemble: int  # E
    sizes: np.ndarray  # of the layers, input first
    parameters: list[Tensor]  # contiguous; they keep alive what lies at the addresses
    addresses: np.ndarray  # of the parameters
    copied: bool  # some are copies, since a parameter is not contiguous

    def check(self, x: Tensor) -> None:
        """The kernels check nothing themselves."""
        if x.shape[1] != self.sizes[0]:
            raise ValueError(f"the input has {x.shape[1]} columns, the first layer takes {self.sizes[0]}")


def _networks(parameters: Sequence[Tensor]) -> _Networks:
    shapes = [[*p.shape] for p in parameters]
    ensemble, *sizes = shapes[0][:1] + [shapes[0][1]] + [shape[-1] for shape in shapes[1::2]]
    expected = [shape for n_in, n_out in pairwise(sizes) for shape in ([ensemble, n_in, n_out], [ensemble, 1, n_out])]
    if shapes != expected or not all(takes_kernel(p) for p in parameters):
        told = ", ".join(f"{[*p.shape]} {p.dtype} on {p.device}" for p in parameters)
        raise ValueError(f"parameters that do not fit each other: {told}")
    copied = not all(p.is_contiguous() for p in parameters)
    contiguous = [p.detach().contiguous() for p in parameters]  # not the parameters: those may be given other data
    return _Networks(ensemble, np.array(sizes, np.int64), contiguous, _addresses(contiguous), copied)


class _Gradients(NamedTuple):
    """Where the gradients of the parameters belong, for the kernels."""

    gradients: list[Tensor]  # read by nobody: they keep alive what lies at the addresses
    addresses: np.ndarray


def _gradients(parameters: Sequence[Tensor], gradient_of: GradientOf) -> _Gradients:
    gradients = destinations(parameters, gradient_of)
    return _Gradients(gradients, _addresses(gradients))


def _fused_forward(x: Tensor, networks: _Networks, final_relu: bool, keep: bool) -> list[Tensor]:
    """The input ``[B, in]``, the outputs ``[E, B, out]`` of the layers between it and the last where they are to be
    kept for a gradient, and the last one's.
    """
    ensemble, sizes, parameters, *_ = networks
    networks.check(x)
    x, batch = x.contiguous(), x.shape[0]
    outputs = [x.new_empty(ensemble, batch, b.shape[2]) for b in (parameters[1::2] if keep else parameters[-1:])]
    addresses = np.zeros(len(sizes), np.int64)
    addresses[0], addresses[-len(outputs) :] = x.data_ptr(), [y.data_ptr() for y in outputs]
    forward_kernel()(sgemm_address(), ensemble, batch, sizes, networks.addresses, addresses, final_relu)
    return [x, *outputs]


def _fused_pull(
    hidden: Sequence[Tensor], networks: _Networks, final_relu: bool, g: Tensor, to: _Gradients, to_input: bool
) -> Tensor | None:
    """The gradients of :func:`_fused_forward`."""
    if g.shape != hidden[-1].shape or not takes_kernel(g):
        found = f"{[*g.shape]}, {g.dtype}, {g.device}"
        raise ValueError(f"the outputs are {[*hidden[-1].shape]}, float32 on the CPU, the gradient to them {found}")
    g, x = g.contiguous(), hidden[0]
    g_input = torch.empty_like(x) if to_input else None
    addresses = (networks.addresses, _addresses(hidden), g.data_ptr(), final_relu, to.addresses)
    columns = (0 if g_input is None else g_input.data_ptr(), 0, x.shape[1])
    backward_kernel()(sgemm_address(), networks.ensemble, x.shape[0], networks.sizes, *addresses, *columns)
    return g_input


@torch.no_grad()
def _regression(
    x: Tensor, target: Tensor, parameters: Sequence[Tensor], gradients: Sequence[Tensor]
) -> tuple[Tensor, Tensor]:
    """:meth:`EnsembleMLP.regress` in PyTorch's operators."""
    hidden = _forward(x, parameters, final_relu=False)
    error = hidden[-1].squeeze(-1) - target
    _pull(hidden, parameters, False, (error * (2.0 / x.shape[0])).unsqueeze(-1), gradients, to_input=False)
    return hidden[-1].squeeze(-1), error.square().sum() / x.shape[0]


def _fused_regression(x: Tensor, target: Tensor, networks: _Networks, to: _Gradients) -> tuple[Tensor, Tensor]:
    """:meth:`EnsembleMLP.regress` in one call."""
    networks.check(x)
    x, shape = x.contiguous(), (networks.ensemble, x.shape[0])
    outputs, loss = x.new_empty(shape), x.new_empty(1)
    addresses = (networks.addresses, x.data_ptr(), to.addresses)
    results = (outputs.numpy(), loss.numpy())
    regress_kernel()(sgemm_address(), *shape, networks.sizes, *addresses, as_array(target), *results)
    return outputs, loss[0]


def _smallest_output_gradient(
    first: Tensor, second: Tensor, parameters: Sequence[Tensor], scale: float, members: int
) -> tuple[Tensor, Tensor]:
    """:meth:`EnsembleMLP.smallest_output_gradient` by autograd."""
    with torch.enable_grad():
        second = second.detach().requires_grad_()
        x = torch.cat([first.detach(), second], dim=-1)
        outputs = _forward(x, [p[:members].detach() for p in parameters], False)[-1].squeeze(-1)
        (gradient,) = torch.autograd.grad(scale * outputs.amin(dim=0).sum(), second)
    return outputs.detach(), gradient


def _fused_smallest_output_gradient(
    x: Tensor, split: int, networks: _Networks, scale: float, members: int
) -> tuple[Tensor, Tensor]:
    """:meth:`EnsembleMLP.smallest_output_gradient` in one call; the first networks come first in memory."""
    networks.check(x)
    batch = x.shape[0]
    outputs, gradient = x.new_empty(members, batch), x.new_empty(batch, x.shape[1] - split)
    columns = (gradient.data_ptr(), split, x.shape[1])
    addresses = (networks.addresses, x.data_ptr())
    descend_kernel()(sgemm_address(), members, batch, networks.sizes, *addresses, scale, outputs.numpy(), *columns)
    return outputs, gradient


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
        # A ParameterList is slow to walk; whoever replaces a parameter (rather than its data) has to do so here too.
        self.parameter_pairs = tuple(p for pair in zip(self.weights, self.biases) for p in pair)
        self.final_relu = final_relu
        self.places = Places()

    def forward(self, x: Tensor) -> Tensor:
        """Outputs ``[E, B, out]`` for inputs ``[B, in]``."""
        return ensemble_mlp(self.parameter_pairs, self.final_relu, x, self.places)

    def vjp(self, x: Tensor, last: int | None = None) -> tuple[Tensor, PullOutputs]:
        """See :func:`ensemble_mlp_vjp`."""
        return ensemble_mlp_vjp(self.parameter_pairs, self.final_relu, x, self.places, last)

    def regress(self, x: Tensor, target: Tensor, gradient_of: GradientOf) -> tuple[Tensor, Tensor]:
        """One regression step of networks with one output each, without autograd.

        Args:
            x: input ``[B, in]``.
            target: ``[B]``, common to all networks.
            gradient_of: where the gradients of the parameters belong; filled. A parameter that is not in it is fixed.

        Returns:
            The outputs ``[E, B]``, and ``sum over E of mean over B of (output - target)^2``.
        """
        if self.parameter_pairs[-1].shape[2] != 1 or target.shape != x.shape[:1]:
            raise ValueError("a regression takes networks with one output and a target [B]")
        if not any(parameter in gradient_of for parameter in self.parameter_pairs):
            raise ValueError("a regression takes places for the gradients of these networks, not of others")
        if _takes_kernel(x, self.parameter_pairs[0]):
            to = self.places.once(_gradients, self.parameter_pairs, gradient_of)
            return _fused_regression(x, target, self.places.once(_networks, self.parameter_pairs), to)
        return _regression(x, target, self.parameter_pairs, destinations(self.parameter_pairs, gradient_of))

    @torch.no_grad()
    def smallest_output_gradient(
        self, first: Tensor, second: Tensor, scale: float, members: int
    ) -> tuple[Tensor, Tensor]:
        """Outputs of networks with one output each, and the gradient of the smallest to a part of the input.

        Args:
            first: the first columns of the input, ``[B, .]``.
            second: the other columns, ``[B, .]``.
            scale: factor of the gradient.
            members: how many networks take part, from the first on: E'.

        Returns:
            The outputs ``[E', B]``, and the gradient of ``scale * sum over B of min over E' of output`` to ``second``.
        """
        ensemble, _, outputs = self.parameter_pairs[-1].shape
        if outputs != 1 or self.final_relu or not 1 <= members <= ensemble:
            raise ValueError(f"the smallest output is that of 1 to {ensemble} networks with one output each")
        x = torch.cat([first, second], dim=-1)
        if _takes_kernel(x, self.parameter_pairs[0]):
            networks = self.places.once(_networks, self.parameter_pairs)
            return _fused_smallest_output_gradient(x, first.shape[1], networks, scale, members)
        return _smallest_output_gradient(first, second, self.parameter_pairs, scale, members)
