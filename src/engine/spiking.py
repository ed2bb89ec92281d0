"""A spiking actor bound to the kernels: its passes and their gradient by hand, bit for bit those of the plain layers
where the products are (README.md).
"""

from __future__ import annotations

from functools import partial

import numpy as np
import torch
from torch import Tensor, nn

from src.actors.health import ActorHealth, layer_health
from src.actors.philox import draw_key
from src.actors.spike_coding import coding_gradient
from src.actors.spiking_actor import SpikingActor
from src.engine import blas, coding, spiking_kernels
from src.engine.bound import VJP, BoundActor
from src.engine.flat import gradient_address
from src.engine.jit import FLOAT, LINE
from src.engine.records import (
    NEURON_CONSTANTS,
    SPIKING_GRADIENT,
    SPIKING_LAYER,
    SPIKING_PASS,
    SPIKING_TRACE,
)

WORKSPACES = 6  # sizes of passes whose buffers are kept: those of updates, of acting, and a few of an evaluation


class BoundSpikingActor(BoundActor):
    """The passes of one actor whose parameters stay where they are.

    Args:
        actor: whose parameters are flat.
    """

    def __init__(self, actor: SpikingActor) -> None:
        self._actor = actor
        self._sgemm = blas.sgemm_address()
        self._spiking_layers = actor.spiking_layers()
        self._shared_lateral: list[tuple[Tensor, Tensor, Tensor]] = []  # weight [K], its rows and their gradient [K, n]
        self._layers = self._layer_records()
        constants = self._spiking_layers[0].constants
        self._constants = np.array([tuple(constants)], NEURON_CONSTANTS)
        offsets = next((layer.lateral.offsets for layer in self._spiking_layers if layer.lateral is not None), ())
        self._offsets = np.array(offsets, np.int64)
        encoder = actor.encoder
        coefficients = coding_gradient(encoder.coding, encoder.time_steps, encoder.threshold)
        self._coding_gradient = np.array([coefficients], np.float32)
        self._workspaces: dict[tuple[int, int, bool], Workspace] = {}

    def _layer_records(self) -> np.ndarray:
        records = np.zeros(len(self._spiking_layers), SPIKING_LAYER)
        for layer, record in zip(self._spiking_layers, records):
            synapse, lateral = layer.synapse, layer.lateral
            record["neurons"], record["inputs"] = synapse.weight.shape
            record["branches"], record["bias_per_branch"] = synapse.branches, synapse.bias_per_branch
            record["weight"], record["bias"] = synapse.weight.data_ptr(), synapse.bias.data_ptr()
            if synapse.branch is None:
                record["branch_weights"] = synapse.weight.data_ptr()
            else:
                record["branch"] = synapse.branch.data_ptr()
            record["grad_weight"] = gradient_address(synapse.weight)
            record["grad_bias"] = gradient_address(synapse.bias)
            if lateral is None:
                continue
            record["neighbours"] = len(lateral.offsets)
            if lateral.weight.dim() == 2:
                record["lateral"] = lateral.weight.data_ptr()
                record["grad_lateral"] = gradient_address(lateral.weight)
            else:  # one weight for all neurons: the kernels take a row of each
                rows, grad_rows = (torch.zeros(len(lateral.offsets), len(synapse.weight)) for _ in range(2))
                self._shared_lateral.append((lateral.weight, rows, grad_rows))
                record["lateral"], record["grad_lateral"] = rows.data_ptr(), grad_rows.data_ptr()
        return records

    @torch.no_grad()
    def raw(self, observation: Tensor, generator: torch.Generator | None) -> Tensor:
        """See :meth:`BoundActor.raw`."""
        self._copy_shared_lateral()
        return self._decode(self._forward(observation, generator, for_gradient=False))

    @torch.no_grad()
    def vjp(
        self, observation: Tensor, generator: torch.Generator | None, with_health: bool
    ) -> tuple[Tensor, ActorHealth | None, VJP]:
        """See :meth:`BoundActor.vjp`."""
        self._copy_shared_lateral()
        workspace = self._forward(observation, generator, for_gradient=True)
        health = self._health(workspace) if with_health else None
        return self._decode(workspace), health, partial(self._vjp, workspace)

    def _copy_shared_lateral(self) -> None:
        for weight, rows, _ in self._shared_lateral:
            rows.copy_(weight.detach().unsqueeze(1))

    def _forward(self, observation: Tensor, generator: torch.Generator | None, for_gradient: bool) -> Workspace:
        encoder = self._actor.encoder
        groups, samples, inputs = observation.shape
        if inputs != encoder.mean.shape[0] or observation.dtype != torch.float32:
            raise ValueError(
                f"observations have {inputs} columns of {observation.dtype}, the encoder takes {encoder.mean.shape[0]} "
                "of torch.float32"
            )
        workspace = self._workspace(groups, samples, for_gradient)
        observation = observation.contiguous()
        fields = (encoder.mean.data_ptr(), encoder.std.data_ptr())
        strength, count = workspace.strength, samples * encoder.size
        coding.field_exponents(
            groups * samples, inputs, encoder.mean.shape[1], observation.data_ptr(), *fields,
            workspace.distance.data_ptr(), strength.data_ptr(),
        )  # fmt: skip
        strength.exp_()
        coding.zero_underflow(strength.numel(), strength.data_ptr())
        steps = encoder.time_steps
        for group in range(groups):
            source = strength.data_ptr() + group * count * FLOAT
            target = workspace.spikes.data_ptr() + group * steps * count * FLOAT
            if encoder.coding == "poisson":
                if generator is None:
                    raise ValueError("Poisson coding draws random spikes: call the actor with generator=...")
                coding.poisson_spikes(steps, count, source, draw_key(generator), target)
            else:
                coding.deterministic_spikes(steps, count, source, np.float32(encoder.threshold), target)
        spiking_kernels.network_forward(
            workspace.passes, self._layers, workspace.traces, self._constants, self._offsets
        )
        return workspace

    def _workspace(self, groups: int, samples: int, for_gradient: bool) -> Workspace:
        """Buffers for these sizes, the last used of them kept; evaluations act for ever fewer episodes."""
        key = (groups, samples, for_gradient)
        workspace = self._workspaces.pop(key, None)
        if workspace is None:
            if len(self._workspaces) >= WORKSPACES:
                del self._workspaces[next(iter(self._workspaces))]
            workspace = Workspace(self._actor, self._layers, groups, samples, for_gradient, self._sgemm)
        self._workspaces[key] = workspace
        return workspace

    def _decode(self, workspace: Workspace) -> Tensor:
        decoder = self._actor.decoder
        raw = (workspace.rates * decoder.weight).sum(-1) + decoder.bias
        return raw.view(workspace.groups, workspace.samples, -1)

    def _health(self, workspace: Workspace) -> ActorHealth:
        layers = [
            layer_health(*seen, layer.constants.threshold, layer.constants.window)
            for seen, layer in zip(workspace.last_layers(), self._spiking_layers, strict=True)
        ]
        return ActorHealth(workspace.spikes[-1].mean(), tuple(layers))

    def _vjp(self, workspace: Workspace, grad_raw: Tensor) -> None:
        encoder, decoder, samples = self._actor.encoder, self._actor.decoder, workspace.samples
        learns = isinstance(encoder.mean, nn.Parameter)
        if grad_raw.shape != (samples, len(decoder.weight)) or grad_raw.dtype != torch.float32:
            found = f"{[*grad_raw.shape]}, {grad_raw.dtype}"
            raise ValueError(
                f"the raw action is {[samples, len(decoder.weight)]}, float32; the gradient w.r.t. it {found}"
            )
        grad_raw = grad_raw.contiguous()
        torch.sum(grad_raw.unsqueeze(-1) * workspace.rates[-samples:], 0, out=decoder.weight.grad)
        torch.sum(grad_raw, 0, out=decoder.bias.grad)
        gradients = workspace.gradients
        gradients["grad_raw"], gradients["decoder"] = grad_raw.data_ptr(), decoder.weight.data_ptr()
        gradients["grad_strength"] = workspace.grad_strength.data_ptr() if learns else 0
        spiking_kernels.network_backward(
            gradients, self._layers, workspace.last_traces, self._constants, self._offsets, self._coding_gradient
        )
        for weight, _, grad_rows in self._shared_lateral:
            torch.sum(grad_rows, 1, out=weight.grad)
        if learns:
            distance, strength = workspace.distance[-samples:], workspace.strength[-samples:]
            slope = workspace.grad_strength.view_as(strength) * strength * distance
            variance = encoder.std.detach().square()
            torch.div(slope.sum(0), variance, out=encoder.mean.grad)
            torch.div((slope * distance).sum(0), variance * encoder.std.detach(), out=encoder.std.grad)


class Workspace:
    """Buffers of the passes over G minibatches of B samples, and the records that say where they lie.

    Args:
        actor: whose passes.
        layers: its layers' records.
        groups: G.
        samples: B.
        for_gradient: whether a gradient of the last minibatch may follow.
        sgemm: the address of the product.
    """

    def __init__(
        self, actor: SpikingActor, layers: np.ndarray, groups: int, samples: int, for_gradient: bool, sgemm: int
    ) -> None:
        encoder, decoder = actor.encoder, actor.decoder
        steps = encoder.time_steps
        self.groups, self.samples, self.steps = groups, samples, steps
        self.neurons = layers["neurons"].tolist()
        fields = (groups * samples, *encoder.mean.shape)
        self.distance, self.strength = torch.empty(fields), torch.empty(fields)  # s - mu and A, [G*B, N, J]
        self.spikes = torch.empty(groups, steps, samples, encoder.size)  # of the encoder
        self.rates = torch.empty(groups * samples, *decoder.weight.shape)  # [G*B, M, P]
        self.grad_strength = torch.empty(samples if for_gradient else 0, encoder.size)
        offsets, end = _lay_out(layers, groups, samples, steps, for_gradient)
        self._block = torch.empty(end // FLOAT)
        self.traces = (offsets + self._block.data_ptr()).view(SPIKING_TRACE).ravel()
        self.last_traces = self.traces.copy()
        self.last_traces["spikes"] += (groups - 1) * steps * samples * layers["neurons"] * FLOAT
        run = (sgemm, groups, steps, samples, int(for_gradient), self.spikes.data_ptr(), self.rates.data_ptr())
        self.passes = np.array([run], SPIKING_PASS)
        self.gradients = np.zeros(1, SPIKING_GRADIENT)
        self.gradients["sgemm"], self.gradients["steps"], self.gradients["samples"] = sgemm, steps, samples
        self.gradients["actions"], self.gradients["input_spikes"] = len(decoder.weight), self.spikes[-1].data_ptr()

    def last_layers(self) -> list[tuple[Tensor, Tensor]]:
        """Spikes and potentials ``[T, B, n]`` of each layer in the last minibatch, of a pass that saved them."""
        found = []
        for trace, neurons in zip(self.last_traces, self.neurons):
            parts = []
            for name in ("spikes", "potentials"):
                start = (int(trace[name]) - self._block.data_ptr()) // FLOAT
                count = self.steps * self.samples * neurons
                parts.append(self._block[start : start + count].view(self.steps, self.samples, neurons))
            found.append((parts[0], parts[1]))
        return found


def _lay_out(layers: np.ndarray, groups: int, samples: int, steps: int, for_gradient: bool) -> tuple[np.ndarray, int]:
    """Byte offsets ``[L, 4]`` of a trace's fields in one block, each at a cache line's start, and the block's size."""
    offsets = np.zeros((len(layers), len(SPIKING_TRACE.names or ())), np.int64)
    end = 0
    for row, layer in zip(offsets, layers):
        neurons = int(steps * samples * layer["neurons"])
        dendritic = int(layer["branches"] > 1)
        weights = int(layer["branch_weights"] == 0) * int(layer["branches"] * layer["neurons"] * layer["inputs"])
        saved = neurons if for_gradient else 0
        sizes = (groups * neurons * FLOAT, saved * FLOAT, dendritic * saved, weights * FLOAT)
        for column, size in enumerate(sizes):
            row[column] = end
            end += -(-size // LINE) * LINE
    return offsets, end
