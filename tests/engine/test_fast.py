"""Whom the engine serves: one that it must not serve would learn something else than its code says."""

from __future__ import annotations

import torch

from src.actors.spiking_actor import SpikingActor
from src.engine.binding import refusal
from tests.engine.actors import actor


def test_the_projects_actors_are_served():
    for name in ("aan", "popsan", "bptsan", "bptsan_wo_ndt", "bptsan_wo_li"):
        assert refusal(actor(name)) is None
    assert refusal(actor("bptsan", encoder__learnable=False)) is None


def test_others_are_refused_with_the_reason():
    class Mine(SpikingActor):
        pass

    mine = actor("bptsan")
    mine.__class__ = Mine
    assert "not Mine" in refusal(mine)
    assert "float32" in refusal(actor("popsan").double())
    assert "CPU" in refusal(actor("popsan").to("meta"))
    frozen = actor("popsan")
    frozen.decoder.weight.requires_grad_(False)
    assert "do not learn" in refusal(frozen)
    tied = actor("popsan")
    tied.layers[1].synapse.bias = tied.layers[0].synapse.bias
    assert "twice" in refusal(tied)
    parametrized = actor("popsan")
    torch.nn.utils.parametrizations.weight_norm(parametrized.layers[1].synapse)
    assert "made of others" in refusal(parametrized)
