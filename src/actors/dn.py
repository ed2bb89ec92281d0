"""Second-order dynamic neurons (DN) of MDC-SAN [Zhang et al., AAAI 2022].

For tau = 1..T, all states 0 before tau = 1 at every decision; o is the spike of the step before, x = W o_in + b::

    c <- d_c c + x
    v <- v (1 - o) + theta_r o                                  reset to theta_r
    u <- u + theta_s o                                          a spike moves the recovery variable
    v, u <- v + (v^2 - v - u + c + Intra),  u + (theta_v v - theta_u u)      both from the values before them
    o <- 1 if v > v_th else 0

``Intra`` is the lateral interaction of :mod:`src.actors.lateral`, beside the current as in the LIF neuron; MDC-SAN has
none. The surrogate gradient is the LIF neuron's (:class:`src.actors.lif.SpikeSurrogate`).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import torch
from torch import Tensor

from src.actors.lif import SpikeSurrogate, lateral_terms


class DNConstants(NamedTuple):
    """Constants of a layer's dynamic neurons."""

    current_decay: float  # d_c
    threshold: float  # v_th
    window: float  # w of the surrogate gradient
    reset_gradient: bool  # the spikes of both resets carry gradient
    lateral_gradient: bool  # lateral terms carry gradient back to the neighbours' spikes
    theta_v: float  # how the potential drives the recovery variable
    theta_u: float  # decay of the recovery variable
    theta_r: float  # potential after a spike
    theta_s: float  # step of the recovery variable at a spike


class DNState(NamedTuple):
    """State of a layer's neurons after a step, ``[B, n]`` each."""

    current: Tensor  # c
    potential: Tensor  # v, before the reset
    recovery: Tensor  # u
    spikes: Tensor  # o

    @classmethod
    def rest(cls, x: Tensor) -> DNState:
        """Before the first step, for input currents like ``x``."""
        zeros = torch.zeros_like(x)
        return cls(zeros, zeros, zeros, zeros)


def dn_step(
    x: Tensor, state: DNState, lateral: Tensor | None, offsets: Sequence[int], constants: DNConstants
) -> DNState:
    """One step of the equations above; arguments as of :func:`src.actors.lif.lif_step`."""
    reset = state.spikes if constants.reset_gradient else state.spikes.detach()
    current = constants.current_decay * state.current + x
    v = state.potential * (1.0 - reset) + constants.theta_r * reset
    u = state.recovery + constants.theta_s * reset
    drive = current
    if lateral is not None:
        neighbours = state.spikes if constants.lateral_gradient else state.spikes.detach()
        for term in lateral_terms(neighbours, lateral, offsets):
            drive = drive + term
    potential = v + (v.square() - v - u + drive)
    recovery = u + (constants.theta_v * v - constants.theta_u * u)
    spikes: Tensor = SpikeSurrogate.apply(potential, constants.threshold, constants.window)  # type: ignore[no-untyped-call]
    return DNState(current, potential, recovery, spikes)
