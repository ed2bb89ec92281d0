"""A spiking actor bound to the kernels: its passes and their gradient by hand, bit for bit those of the plain layers
where the products are (README.md).
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

import numpy as np
import torch
from torch import Tensor, nn

from src.actors.health import ActorHealth, layer_health
from src.actors.philox import draw_key
from src.actors.spike_coding import coding_gradient
from src.actors.spiking_actor import SpikingActor
from src.engine import blas, coding, spiking_kernels
from src.engine.bound import NotCopyable, Pull
from src.engine.jit import FLOAT, LINE
from src.engine.records import (
    NEURON,
    SPIKING_GRADIENT,
    SPIKING_LAYER,
    SPIKING_PASS,
    SPIKING_TRACE,
)

WORKSPACES = 6  # sizes of passes whose buffers are kept: those of updates, of acting, and a few of an evaluation


class BoundSpikingActor(NotCopyable):
    """The passes of one actor whose parameters stay where they are.

    Args:
        actor: on the CPU, float32, contiguous.
        gradient_of: where the gradients of its parameters go; None for an actor that does not learn.
    """

    def __init__(self, actor: SpikingActor, gradient_of: Mapping[nn.Parameter, Tensor] | None = None) -> None:
        self._actor, self._gradient_of = actor, gradient_of
        self._spiking_layers = actor.spiking_layers()
        self._shared_lateral: list[tuple[Tensor, Tensor, Tensor]] = []  # weight [K], its rows and their gradient [K, n]
        self._layers = self._layer_records()
        self._kept_alive: list[Tensor] = []
        self._acting_layers = self._layers.copy()
        self._expansions = np.zeros(len(self._layers), SPIKING_TRACE)
        for index, record in enumerate(self._layers):
            if record["branches"] > 1:
                buffer = torch.zeros(int(record["branches"] * record["neurons"]), int(record["inputs"]))
                self._kept_alive.append(buffer)
                self._expansions[index]["expanded"] = buffer.data_ptr()
                self._acting_layers[index]["expanded"] = buffer.data_ptr()
        constants = self._spiking_layers[0].constants
        self._neurons = np.array([tuple(constants)], NEURON)
        offsets = next((layer.lateral.offsets for layer in self._spiking_layers if layer.lateral is not None), ())
        self._offsets = np.array(offsets, np.int64)
        encoder = actor.encoder
        coefficients = coding_gradient(encoder.coding, encoder.time_steps, encoder.threshold)
        self._coding_gradient = np.array([coefficients], np.float32)
        self._workspaces: dict[tuple[int, int, bool, bool], Workspace] = {}
        self._refreshed = -1

    def _layer_records(self) -> np.ndarray:
        records = np.zeros(len(self._spiking_layers), SPIKING_LAYER)
        for layer, record in zip(self._spiking_layers, records):
            synapse, lateral = layer.synapse, layer.lateral
            record["neurons"], record["inputs"] = synapse.weight.shape
            record["branches"], record["bias_per_branch"] = synapse.branches, synapse.bias_per_branch
            record["weight"], record["bias"] = synapse.weight.data_ptr(), synapse.bias.data_ptr()
            if synapse.branch is None:
                record["expanded"] = synapse.weight.data_ptr()
            else:
                record["branch"] = synapse.branch.data_ptr()
            to = self._gradient_of
            if to is not None:
                record["to_weight"], record["to_bias"] = to[synapse.weight].data_ptr(), to[synapse.bias].data_ptr()
            if lateral is None:
                continue
            record["neighbours"] = len(lateral.offsets)
            if lateral.weight.dim() == 2:
                record["lateral"] = lateral.weight.data_ptr()
                record["to_lateral"] = 0 if to is None else to[lateral.weight].data_ptr()
            else:  # one weight for all neurons: the kernels take a row of each
                rows, to_rows = (torch.zeros(len(lateral.offsets), len(synapse.weight)) for _ in range(2))
                self._shared_lateral.append((lateral.weight, rows, to_rows))
                record["lateral"], record["to_lateral"] = rows.data_ptr(), to_rows.data_ptr()
        return records

    def refresh(self) -> None:
        """Expand the branch weights for acting; to be called when the parameters have changed."""
        self._copy_shared_lateral()
        self._refreshed = self._versions()
        if self._kept_alive:
            spiking_kernels.expand_all(self._layers, self._expansions)

    def _versions(self) -> int:
        """Moves when a weight is changed in place by PyTorch (a loaded state, an edit), not by the engine's steps."""
        return sum(layer.synapse.weight._version for layer in self._spiking_layers)

    @torch.no_grad()
    def act(self, observation: Tensor, generator: torch.Generator | None) -> Tensor:
        """Raw actions ``[B, M]`` for ``[B, N]`` by the parameters as they were at the last :meth:`refresh`."""
        if self._versions() != self._refreshed:  # somebody has changed a weight by hand
            self.refresh()
        workspace = self._forward(self._acting_layers, observation.unsqueeze(0), generator, keep=False)
        return self._decode(workspace)[0]

    @torch.no_grad()
    def raw(self, observation: Tensor, generator: torch.Generator | None) -> Tensor:
        """Raw actions ``[G, B, M]`` of G minibatches ``[G, B, N]``, each of which draws its own chance."""
        self._copy_shared_lateral()
        return self._decode(self._forward(self._layers, observation, generator, keep=False))

    @torch.no_grad()
    def vjp(
        self, observation: Tensor, generator: torch.Generator | None, with_health: bool
    ) -> tuple[Tensor, ActorHealth | None, Pull]:
        """Raw actions ``[G, B, M]`` of G minibatches; health and vector-Jacobian product of the last.

        The product fills the gradients of the parameters, before the next pass of these sizes.
        """
        self._copy_shared_lateral()
        workspace = self._forward(self._layers, observation, generator, keep=True)
        health = self._health(workspace) if with_health else None
        return self._decode(workspace), health, partial(self._pull, workspace)

    def _copy_shared_lateral(self) -> None:
        for weight, rows, _ in self._shared_lateral:
            rows.copy_(weight.detach().unsqueeze(1))

    def _forward(
        self, layers: np.ndarray, observation: Tensor, generator: torch.Generator | None, keep: bool
    ) -> Workspace:
        encoder = self._actor.encoder
        groups, samples, inputs = observation.shape
        if inputs != encoder.mean.shape[0] or observation.dtype != torch.float32:
            raise ValueError(
                f"observations have {inputs} columns of {observation.dtype}, the encoder takes {encoder.mean.shape[0]} "
                "of torch.float32"
            )
        workspace = self._workspace(layers, groups, samples, keep)
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
        workspace.passes["sgemm"] = blas.sgemm_address()
        spiking_kernels.network_forward(workspace.passes, layers, workspace.traces, self._neurons, self._offsets)
        return workspace

    def _workspace(self, layers: np.ndarray, groups: int, samples: int, keep: bool) -> Workspace:
        """Buffers for these sizes, the last used of them kept; evaluations act for ever fewer episodes."""
        key = (groups, samples, keep, layers is self._acting_layers)  # acting has its branch weights at hand
        workspace = self._workspaces.pop(key, None)
        if workspace is None:
            if len(self._workspaces) >= WORKSPACES:
                del self._workspaces[next(iter(self._workspaces))]
            workspace = Workspace(self._actor, layers, groups, samples, keep)
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

    def _pull(self, workspace: Workspace, to_raw: Tensor) -> None:
        to, actor, samples = self._gradient_of, self._actor, workspace.samples
        assert to is not None
        encoder, decoder = actor.encoder, actor.decoder
        learns = encoder.mean in to  # type: ignore[comparison-overlap]
        if to_raw.shape != (samples, len(decoder.weight)) or to_raw.dtype != torch.float32:
            found = f"{[*to_raw.shape]}, {to_raw.dtype}"
            raise ValueError(f"the raw action is {[samples, len(decoder.weight)]}, float32; the gradient to it {found}")
        to_raw = to_raw.contiguous()
        torch.sum(to_raw.unsqueeze(-1) * workspace.rates[-samples:], 0, out=to[decoder.weight])
        torch.sum(to_raw, 0, out=to[decoder.bias])
        gradients = workspace.gradients
        gradients["sgemm"] = blas.sgemm_address()
        gradients["to_raw"], gradients["decoder"] = to_raw.data_ptr(), decoder.weight.data_ptr()
        gradients["to_strength"] = workspace.to_strength.data_ptr() if learns else 0
        spiking_kernels.network_backward(
            gradients, self._layers, workspace.last_traces, self._neurons, self._offsets, self._coding_gradient
        )
        for weight, _, to_rows in self._shared_lateral:
            torch.sum(to_rows, 1, out=to[weight])  # type: ignore[index]
        if learns:
            distance, strength = workspace.distance[-samples:], workspace.strength[-samples:]
            slope = workspace.to_strength.view_as(strength) * strength * distance
            variance = encoder.std.detach().square()
            to[encoder.mean].copy_(slope.sum(0) / variance)  # type: ignore[index]
            to[encoder.std].copy_((slope * distance).sum(0) / (variance * encoder.std.detach()))  # type: ignore[index]


class Workspace:
    """Buffers of the passes over G minibatches of B samples, and the records that say where they lie.

    Args:
        actor: whose passes.
        layers: its layers' records.
        groups: G.
        samples: B.
        keep: whether a gradient of the last minibatch may follow.
    """

    def __init__(self, actor: SpikingActor, layers: np.ndarray, groups: int, samples: int, keep: bool) -> None:
        encoder, decoder = actor.encoder, actor.decoder
        steps = encoder.time_steps
        self.groups, self.samples, self.steps = groups, samples, steps
        self.neurons = layers["neurons"].tolist()
        fields = (groups * samples, *encoder.mean.shape)
        self.distance, self.strength = torch.empty(fields), torch.empty(fields)  # s - mu and A, [G*B, N, J]
        self.spikes = torch.empty(groups, steps, samples, encoder.size)  # of the encoder
        self.rates = torch.empty(groups * samples, *decoder.weight.shape)  # [G*B, M, P]
        self.to_strength = torch.empty(samples if keep else 0, encoder.size)
        offsets, end = _lay_out(layers, groups, samples, steps, keep)
        self._block = torch.empty(end // FLOAT)
        self.traces = (offsets + self._block.data_ptr()).view(SPIKING_TRACE).ravel()
        self.last_traces = self.traces.copy()
        self.last_traces["spikes"] += (groups - 1) * steps * samples * layers["neurons"] * FLOAT
        run = (0, groups, steps, samples, int(keep), self.spikes.data_ptr(), self.rates.data_ptr())
        self.passes = np.array([run], SPIKING_PASS)
        self.gradients = np.zeros(1, SPIKING_GRADIENT)
        self.gradients["steps"], self.gradients["samples"] = steps, samples
        self.gradients["actions"], self.gradients["input_spikes"] = len(decoder.weight), self.spikes[-1].data_ptr()

    def last_layers(self) -> list[tuple[Tensor, Tensor]]:
        """Spikes and potentials ``[T, B, n]`` of each layer in the last minibatch, of a pass that kept them."""
        found = []
        for trace, neurons in zip(self.last_traces, self.neurons):
            parts = []
            for name in ("spikes", "potentials"):
                start = (int(trace[name]) - self._block.data_ptr()) // FLOAT
                count = self.steps * self.samples * neurons
                parts.append(self._block[start : start + count].view(self.steps, self.samples, neurons))
            found.append((parts[0], parts[1]))
        return found


def _lay_out(layers: np.ndarray, groups: int, samples: int, steps: int, keep: bool) -> tuple[np.ndarray, int]:
    """Byte offsets ``[L, 4]`` of a trace's fields in one block, each at a cache line's start, and the block's size."""
    offsets = np.zeros((len(layers), len(SPIKING_TRACE.names or ())), np.int64)
    end = 0
    for row, layer in zip(offsets, layers):
        neurons = int(steps * samples * layer["neurons"])
        dendritic = int(layer["branches"] > 1)
        expanded = int(layer["expanded"] == 0) * int(layer["branches"] * layer["neurons"] * layer["inputs"])
        kept = neurons if keep else 0
        sizes = (groups * neurons * FLOAT, kept * FLOAT, dendritic * kept, expanded * FLOAT)
        for column, size in enumerate(sizes):
            row[column] = end
            end += -(-size // LINE) * LINE
    return offsets, end
