"""An actor's raw action and gradients, for tests."""

from __future__ import annotations

import torch


def places(actor):
    """Where gradients go; what is not filled shows."""
    return {
        parameter: torch.full(parameter.shape, torch.nan, dtype=parameter.dtype) for parameter in actor.parameters()
    }


def gradients(actor, observation, to_raw):
    """Raw action and gradients."""
    raw, _, pull = actor.vjp(observation)
    gradient_of = places(actor)
    pull(to_raw, gradient_of)
    return [raw, *gradient_of.values()]
