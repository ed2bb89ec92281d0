"""The spiking actors of the literature, step by step, from their papers' equations and an actor's parameters.

Nothing of ``src`` computes here: layers advance together, a step at a time; the surrogate gradient is autograd's own
of a clipped ramp.
"""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor


def fire(v: Tensor) -> Tensor:
    """``v > 0.5``, with the slope of ``clip(v, 0, 1)``."""
    ramp = v.clamp(0, 1)
    return (v > 0.5).to(v.dtype) + ramp - ramp.detach()


def currents(synapse: Any, o: Tensor) -> Tensor:
    """Linear or dendritic, ``[B, inputs] -> [B, n]``, a branch after the other."""
    if synapse.branch is None:
        return o @ synapse.weight.T + synapse.bias
    branches = [o @ (synapse.weight * (synapse.branch == m)).T for m in range(synapse.branches)]
    return torch.stack(branches).max(0).values + synapse.bias


def neighbours(layer: Any, o: Tensor) -> Tensor:
    """Lateral interaction, neuron by neuron."""
    if layer.lateral is None:
        return torch.zeros_like(o)
    weight, n = layer.lateral.weight, o.shape[1]
    columns = []
    for j in range(n):
        terms = [weight[k, j] * o[:, j + d] for k, d in enumerate(layer.lateral.offsets) if 0 <= j + d < n]
        columns.append(sum(terms))
    return torch.stack(columns, dim=1)


def within_actions(layer: Any, o: Tensor, P: int) -> Tensor:
    """ILC-SAN's connections of the output population, pair by pair."""
    own = layer.output_lateral
    pairs, total = iter(own.weight), [torch.zeros_like(o[:, 0]) for _ in range(o.shape[1])]
    for m, i, j in own.exists.nonzero().tolist():
        total[m * P + i] = total[m * P + i] + next(pairs) * o[:, m * P + j]
    result = torch.stack(total, dim=1)
    return result if own.bias is None else result + own.bias


def raw_action(actor: Any, config: Any, s: Tensor) -> Tensor:
    """The raw action ``[B, M]`` of observations ``[B, N]``."""
    c, e = config.actor, actor.encoder
    if config.encoder.input_map == "tanh":
        s = s.tanh()
    strength = torch.exp(-((s[:, :, None] - e.mean) ** 2) / (2 * e.std**2)).flatten(1)
    layers = list(actor.layers)
    states: list[dict[str, Tensor]] = []
    for layer in layers:
        zeros = s.new_zeros(len(s), len(layer.synapse.weight))
        states.append({"c": zeros, "v": zeros, "u": zeros, "o": zeros})
    voltage = torch.zeros_like(strength)
    m = s.new_zeros(len(s), len(actor.decoder.weight))
    spikes, membranes = [], []
    for _ in range(c.time_steps):
        if config.encoder.coding == "analog":
            o = strength
        else:
            voltage = voltage + strength
            hard = (voltage > config.encoder.threshold).to(s.dtype)
            o = hard + voltage - voltage.detach()
            voltage = voltage - config.encoder.threshold * o
        for layer, state in zip(layers, states):
            before = state["o"]
            heard = before if c.lateral_gradient else before.detach()
            reset = before if c.reset_gradient else before.detach()
            x = currents(layer.synapse, o)
            if layer.output_lateral is not None:
                x = x + within_actions(layer, heard, c.output_population)
            state["c"] = c.current_decay * state["c"] + x
            intra = neighbours(layer, heard)
            if c.neuron == "dn":
                v = state["v"] * (1 - reset) + c.dn.theta_r * reset
                u = state["u"] + c.dn.theta_s * reset
                dv = v * v - v - u + state["c"] + intra
                du = c.dn.theta_v * v - c.dn.theta_u * u
                state["v"], state["u"] = v + dv, u + du
            else:
                state["v"] = c.voltage_decay * state["v"] * (1 - reset) + state["c"] + intra
            state["o"] = o = fire(state["v"])
        spikes.append(o)
        per_action = o.reshape(len(s), *actor.decoder.weight.shape)
        m = c.readout_decay * m + (per_action * actor.decoder.weight).sum(-1) + actor.decoder.bias
        membranes.append(m)
    if c.readout == "rate":
        rates = (sum(spikes) / c.time_steps).reshape(len(s), *actor.decoder.weight.shape)
        return (rates * actor.decoder.weight).sum(-1) + actor.decoder.bias
    if c.readout == "last_membrane":
        return m
    if c.readout == "mean_membrane":
        return sum(membranes) / c.time_steps
    best = membranes[0]
    for m in membranes[1:]:
        best = torch.where(m.abs() > best.abs(), m, best)
    return best
