"""Which actors the engine supports: one that it must not take would learn something else than its code says."""

from __future__ import annotations

import torch

from src.actors.spiking_actor import SpikingActor
from src.engine.fast import unsupported_reason
from tests.engine.actors import actor


def test_the_projects_actors_are_served():
    for name in ("aan", "popsan", "bptsan", "bptsan_wo_ndt", "bptsan_wo_li"):
        assert unsupported_reason(actor(name)) is None
    assert unsupported_reason(actor("bptsan", encoder__learnable=False)) is None


def test_others_are_refused_with_the_reason():
    class Mine(SpikingActor):
        pass

    mine = actor("bptsan")
    mine.__class__ = Mine
    assert "not Mine" in unsupported_reason(mine)
    assert "float32" in unsupported_reason(actor("popsan").double())
    assert "CPU" in unsupported_reason(actor("popsan").to("meta"))
    frozen = actor("popsan")
    frozen.decoder.weight.requires_grad_(False)
    assert "do not learn" in unsupported_reason(frozen)
    tied = actor("popsan")
    tied.layers[1].synapse.bias = tied.layers[0].synapse.bias
    assert "twice" in unsupported_reason(tied)
    parametrized = actor("popsan")
    torch.nn.utils.parametrizations.weight_norm(parametrized.layers[1].synapse)
    assert "made of others" in unsupported_reason(parametrized)
