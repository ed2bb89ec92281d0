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
from src.actors.spiking_layer import SpikingLayer
from src.engine import blas, coding, spiking_kernels
from src.engine.bound import VJP, BoundActor
from src.engine.flat import gradient_address
from src.engine.primitives import FLOAT
from src.engine.records import NEURON_CONSTANTS, SPIKING_LAYER, SPIKING_PASS, SPIKING_TRACE

WORKSPACES = 6  # sizes of passes whose buffers are kept: those of updates, of acting, and a few of an evaluation


class BoundSpikingActor(BoundActor):
    """The passes of one actor whose parameters stay where they are.

    Args:
        actor: whose parameters are flat.
    """

    def __init__(self, actor: SpikingActor) -> None:
        self._actor = actor
        self._sgemm = blas.sgemm_address()
        self._shared_lateral: list[tuple[Tensor, Tensor, Tensor]] = []  # weight [K], its rows and their gradient [K, n]
        layers = actor.spiking_layers()
        self._layers = np.zeros(len(layers), SPIKING_LAYER)
        for layer, record in zip(layers, self._layers):
            self._bind_layer(layer, record)
        self._constants = np.array([tuple(layers[0].constants)], NEURON_CONSTANTS)
        offsets = next((layer.lateral.offsets for layer in layers if layer.lateral is not None), ())
        self._offsets = np.array(offsets, np.int64)
        encoder = actor.encoder
        coefficients = coding_gradient(encoder.coding, encoder.time_steps, encoder.threshold)
        self._coding_gradient = np.array([coefficients], np.float32)
        self._workspaces: dict[tuple[int, int, bool], Workspace] = {}

    def _bind_layer(self, layer: SpikingLayer, record: np.void) -> None:
        synapse, lateral = layer.synapse, layer.lateral
        record["neurons"], record["inputs"] = synapse.weight.shape
        record["branches"], record["bias_per_branch"] = synapse.branches, synapse.bias_per_branch
        record["weight"], record["bias"] = synapse.weight.data_ptr(), synapse.bias.data_ptr()
        record["grad_weight"], record["grad_bias"] = map(gradient_address, (synapse.weight, synapse.bias))
        if synapse.branch is not None:
            record["branch"] = synapse.branch.data_ptr()
        if lateral is None:
            return
        record["neighbours"] = len(lateral.offsets)
        if lateral.weight.dim() == 2:
            record["lateral"], record["grad_lateral"] = lateral.weight.data_ptr(), gradient_address(lateral.weight)
        else:  # one weight for all neurons: the kernels take a row of each
            rows, grad_rows = (torch.zeros(len(lateral.offsets), len(synapse.weight)) for _ in range(2))
            self._shared_lateral.append((lateral.weight, rows, grad_rows))
            record["lateral"], record["grad_lateral"] = rows.data_ptr(), grad_rows.data_ptr()

    @torch.no_grad()
    def raw(self, observation: Tensor, generator: torch.Generator | None) -> Tensor:
        """See :meth:`BoundActor.raw`."""
        return self._decode(self._forward(observation, generator, for_gradient=False))

    @torch.no_grad()
    def vjp(
        self, observation: Tensor, generator: torch.Generator | None, with_health: bool
    ) -> tuple[Tensor, ActorHealth | None, VJP]:
        """See :meth:`BoundActor.vjp`."""
        workspace = self._forward(observation, generator, for_gradient=True)
        health = self._health(workspace) if with_health else None
        return self._decode(workspace), health, partial(self._vjp, workspace)

    def _forward(self, observation: Tensor, generator: torch.Generator | None, for_gradient: bool) -> Workspace:
        encoder = self._actor.encoder
        groups, samples, inputs = observation.shape
        if inputs != encoder.mean.shape[0] or observation.dtype != torch.float32:
            raise ValueError(
                f"observations have {inputs} columns of {observation.dtype}, the encoder takes {encoder.mean.shape[0]} "
                "of torch.float32"
            )
        workspace = self._workspace(groups, samples, for_gradient)
        for weight, rows, _ in self._shared_lateral:
            rows.copy_(weight.detach().unsqueeze(1))
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
            target = workspace.input_spikes.data_ptr() + group * steps * count * FLOAT
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
            workspace = Workspace(self._actor, groups, samples, for_gradient, self._sgemm)
        self._workspaces[key] = workspace
        return workspace

    def _decode(self, workspace: Workspace) -> Tensor:
        decoder = self._actor.decoder
        raw = (workspace.rates * decoder.weight).sum(-1) + decoder.bias
        return raw.view(workspace.groups, workspace.samples, -1)

    def _health(self, workspace: Workspace) -> ActorHealth:
        layers = [
            layer_health(seen["spikes"][-1], seen["potentials"], layer.constants.threshold, layer.constants.window)
            for seen, layer in zip(workspace.layers, self._actor.spiking_layers(), strict=True)
        ]
        return ActorHealth(workspace.input_spikes[-1].mean(), tuple(layers))

    def _vjp(self, workspace: Workspace, grad_raw: Tensor) -> None:
        encoder, decoder, samples = self._actor.encoder, self._actor.decoder, workspace.samples
        if grad_raw.shape != (samples, len(decoder.weight)) or grad_raw.dtype != torch.float32:
            found = f"{[*grad_raw.shape]}, {grad_raw.dtype}"
            raise ValueError(
                f"the raw action is {[samples, len(decoder.weight)]}, float32; the gradient w.r.t. it {found}"
            )
        grad_raw = grad_raw.contiguous()
        torch.sum(grad_raw.unsqueeze(-1) * workspace.rates[-samples:], 0, out=decoder.weight.grad)
        torch.sum(grad_raw, 0, out=decoder.bias.grad)
        workspace.passes["grad_raw"] = grad_raw.data_ptr()
        spiking_kernels.network_backward(
            workspace.passes, self._layers, workspace.traces, self._constants, self._offsets, self._coding_gradient
        )
        for weight, _, grad_rows in self._shared_lateral:
            torch.sum(grad_rows, 1, out=weight.grad)
        if len(workspace.grad_strength):
            distance, strength = workspace.distance[-samples:], workspace.strength[-samples:]
            slope = workspace.grad_strength.view_as(strength) * strength * distance
            variance = encoder.std.detach().square()
            torch.div(slope.sum(0), variance, out=encoder.mean.grad)
            torch.div((slope * distance).sum(0), variance * encoder.std.detach(), out=encoder.std.grad)


class Workspace:
    """Buffers of the passes over G minibatches of B samples, and the records that say where they lie.

    All begin at a cache line, as PyTorch's memory does.

    Args:
        actor: whose passes.
        groups: G.
        samples: B.
        for_gradient: whether a gradient of the last minibatch may follow.
        sgemm: the address of the product.
    """

    def __init__(self, actor: SpikingActor, groups: int, samples: int, for_gradient: bool, sgemm: int) -> None:
        encoder, decoder = actor.encoder, actor.decoder
        steps, learns = encoder.time_steps, isinstance(encoder.mean, nn.Parameter)
        self.groups, self.samples = groups, samples
        fields = (groups * samples, *encoder.mean.shape)
        self.distance, self.strength = torch.empty(fields), torch.empty(fields)  # s - mu and A, [G*B, N, J]
        self.input_spikes = torch.empty(groups, steps, samples, encoder.size)
        self.rates = torch.empty(groups * samples, *decoder.weight.shape)  # [G*B, M, P]
        self.grad_strength = torch.empty(samples if for_gradient and learns else 0, encoder.size)
        self.layers: list[dict[str, Tensor]] = []  # by the names and shapes of SPIKING_TRACE
        self.traces = np.zeros(len(actor.layers), SPIKING_TRACE)
        saved = steps if for_gradient else 0
        for layer, trace in zip(actor.spiking_layers(), self.traces):
            branches, (neurons, inputs) = layer.synapse.branches, layer.synapse.weight.shape
            dendritic = branches > 1
            buffers = {
                "spikes": torch.empty(groups, steps, samples, neurons),
                "branch_weights": torch.empty(branches * neurons, inputs) if dendritic else layer.synapse.weight,
                "potentials": torch.empty(saved, samples, neurons),
                "argmax_branch": torch.empty(saved if dendritic else 0, samples, neurons, dtype=torch.int8),
            }
            self.layers.append(buffers)
            for name, buffer in buffers.items():
                trace[name] = buffer.data_ptr()
        sizes = (sgemm, groups, steps, samples, len(decoder.weight), for_gradient)
        addresses = (self.input_spikes.data_ptr(), self.rates.data_ptr(), decoder.weight.data_ptr())
        self.passes = np.array([(*sizes, *addresses, 0, self.grad_strength.data_ptr())], SPIKING_PASS)
