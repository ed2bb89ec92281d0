"""Multilayer perceptrons bound to the kernels: the AAN, SAC's log-std, the twin critics."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from torch import Tensor

from src.actors.health import NOTHING_SPIKES, ActorHealth
from src.actors.mlp import EnsembleMLP, MLPActor
from src.engine import blas, mlp_kernels
from src.engine.bound import VJP, BoundActor, NotCopyable
from src.engine.flat import gradient_address
from src.engine.records import MLP_LAYER

#: What a forward pass saves for its gradient: the input ``[B, in]``, then the output of each layer, ``[E, B, .]``.
Saved = list[Tensor]


def last_rows(saved: Saved, rows: int) -> Saved:
    """The same of the last rows alone; of one network."""
    return [h[..., -rows:, :].contiguous() for h in saved]


class BoundMLP(NotCopyable):
    """Networks one behind the other, bound as one.

    Args:
        networks: the first feeds the second; their parameters are flat.
    """

    def __init__(self, *networks: EnsembleMLP) -> None:
        pairs = [pair for network in networks for pair in zip(network.weights, network.biases)]
        self.ensemble = len(pairs[0][0])
        self.final_relu = networks[-1].final_relu
        self._sgemm = blas.sgemm_address()
        self._outputs = [weight.shape[2] for weight, _ in pairs]
        self._layers = np.zeros(len(pairs), MLP_LAYER)
        for record, (weight, bias) in zip(self._layers, pairs):
            record["inputs"], record["outputs"] = weight.shape[1:]
            record["weight"], record["bias"] = weight.data_ptr(), bias.data_ptr()
            record["grad_weight"], record["grad_bias"] = gradient_address(weight), gradient_address(bias)

    def forward(self, x: Tensor) -> Tensor:
        """Outputs ``[E, B, out]`` for ``[B, in]``; saves nothing."""
        return self._run(x, self._outputs[-1:])[-1]

    def forward_saving(self, x: Tensor) -> Saved:
        """:meth:`forward` with what :meth:`backward` needs; the last of it is the output."""
        return self._run(x, self._outputs)

    def _run(self, x: Tensor, sizes: Sequence[int]) -> Saved:
        x = self._checked(x)
        outputs = [x.new_empty(self.ensemble, len(x), size) for size in sizes]
        hidden = np.zeros(len(self._layers) + 1, np.int64)
        hidden[0] = x.data_ptr()
        hidden[-len(outputs) :] = [y.data_ptr() for y in outputs]
        mlp_kernels.forward(self._sgemm, self.ensemble, len(x), self._layers, hidden, self.final_relu)
        return [x, *outputs]

    def backward(self, saved: Saved, grad_outputs: Tensor, with_input: bool = False) -> Tensor | None:
        """Given the gradient w.r.t. the outputs ``[E, B, out]``, fill the parameters'; give the input's if wanted."""
        if grad_outputs.shape != saved[-1].shape or grad_outputs.dtype != torch.float32:
            found = f"{[*grad_outputs.shape]}, {grad_outputs.dtype}"
            raise ValueError(f"the outputs are {[*saved[-1].shape]}, float32; the gradient w.r.t. them {found}")
        grad_outputs, x = grad_outputs.contiguous(), saved[0]
        grad_input = torch.empty_like(x) if with_input else None
        hidden = np.array([h.data_ptr() for h in saved], np.int64)
        columns = (0 if grad_input is None else grad_input.data_ptr(), 0, x.shape[1])
        arguments = (self._layers, hidden, grad_outputs.data_ptr(), self.final_relu, 1, *columns)
        mlp_kernels.backward(self._sgemm, self.ensemble, len(x), *arguments)
        return grad_input

    def squared_error_step(self, x: Tensor, target: Tensor) -> tuple[Tensor, Tensor]:
        """Fill the gradients of ``sum over E of mean over B of (output - target)^2``, of networks with one output.

        Returns the outputs ``[E, B]`` and that loss, for inputs ``[B, in]`` and a common target ``[B]``.
        """
        x, target = self._checked(x), target.contiguous()
        if target.shape != x.shape[:1] or target.dtype != torch.float32:
            raise ValueError(
                f"the target is {[*target.shape]}, {target.dtype}; for {len(x)} inputs a [{len(x)}], float32"
            )
        outputs, loss = x.new_empty(self.ensemble, len(x)), x.new_empty(1)
        addresses = (x.data_ptr(), target.data_ptr(), outputs.data_ptr(), loss.data_ptr())
        mlp_kernels.squared_error_step(self._sgemm, self.ensemble, len(x), self._layers, *addresses)
        return outputs, loss[0]

    def minimum_input_gradient(
        self, x: Tensor, first_column: int, scale: float, networks: int
    ) -> tuple[Tensor, Tensor]:
        """The gradient of ``scale * sum over B of min over the first E' networks of the output`` to columns of x.

        Returns the outputs ``[E', B]`` and that gradient to the columns from ``first_column`` on.
        """
        x = self._checked(x)
        outputs, gradient = x.new_empty(networks, len(x)), x.new_empty(len(x), x.shape[1] - first_column)
        addresses = (x.data_ptr(), scale, outputs.data_ptr(), gradient.data_ptr(), first_column, x.shape[1])
        mlp_kernels.minimum_input_gradient(self._sgemm, networks, len(x), self._layers, *addresses)
        return outputs, gradient

    def _checked(self, x: Tensor) -> Tensor:
        if x.shape[1] != self._layers[0]["inputs"] or x.dtype != torch.float32:
            raise ValueError(f"the input is {[*x.shape]}, {x.dtype}; the first layer takes {self._layers[0]['inputs']}")
        return x.contiguous()


class BoundMLPActor(BoundActor):
    """The AAN bound to the kernels, trunk and head as one network."""

    def __init__(self, actor: MLPActor) -> None:
        self._network = BoundMLP(actor.hidden, actor.output)

    def raw(self, observation: Tensor, generator: torch.Generator | None) -> Tensor:
        """See :meth:`BoundActor.raw`."""
        return self._network.forward(observation.flatten(0, 1)).squeeze(0).unflatten(0, observation.shape[:2])

    def vjp(
        self, observation: Tensor, generator: torch.Generator | None, with_health: bool
    ) -> tuple[Tensor, ActorHealth | None, VJP]:
        """See :meth:`BoundActor.vjp`."""
        saved = self._network.forward_saving(observation.flatten(0, 1))
        raw = saved[-1].squeeze(0).unflatten(0, observation.shape[:2])
        last = last_rows(saved, observation.shape[1])

        def vjp_fn(grad_raw: Tensor) -> None:
            self._network.backward(last, grad_raw.unsqueeze(0))

        return raw, NOTHING_SPIKES if with_health else None, vjp_fn
