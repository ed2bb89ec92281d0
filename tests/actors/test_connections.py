"""Synapses, dendritic partition, lateral interaction, decoder, initialisation."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from src.actors.decoder import PopulationDecoder
from src.actors.initialisation import Initialiser
from src.actors.lateral import LateralInteraction, neighbour_offsets
from src.actors.synapse import Synapse, dendritic_partition, maxout
from src.config.schema import ConfigurationError
from src.streams import Streams
from tests.actors.configuration import configuration

DENDRITIC = configuration("bptsan").actor.dendritic
LATERAL = configuration("bptsan").actor.lateral


def synapse(inputs=12, neurons=6, seed=0, **options):
    config = replace(DENDRITIC, **options)
    streams = Streams(seed)
    return Synapse(config, inputs, neurons, Initialiser(streams, "test"), streams.sequence("dendrite mask", 0))


@settings(max_examples=40, deadline=None)
@given(st.integers(1, 20), st.integers(1, 60), st.integers(1, 8), st.integers(0, 2**62))
def test_partition(neurons, inputs, branches, seed):
    """Exclusive and exhaustive (each synapse has one branch index), balanced, reproducible."""
    if branches > inputs:
        with pytest.raises(ConfigurationError, match="branches"):
            dendritic_partition(Streams(seed).sequence("dendrite mask", 0), neurons, inputs, branches)
        return
    branch = dendritic_partition(Streams(seed).sequence("dendrite mask", 0), neurons, inputs, branches)
    assert branch.shape == (neurons, inputs)
    assert branch.min() >= 0
    assert branch.max() < branches
    sizes = torch.stack([(branch == index).sum(1) for index in range(branches)])
    assert (sizes.max(0).values - sizes.min(0).values).max() <= 1
    assert torch.equal(
        branch, dendritic_partition(Streams(seed).sequence("dendrite mask", 0), neurons, inputs, branches)
    )


def test_partition_differs_per_neuron_layer_and_seed():
    draw = lambda seed, layer: dendritic_partition(Streams(seed).sequence("dendrite mask", layer), 8, 64, 2)  # noqa: E731
    assert len({tuple(row.tolist()) for row in draw(0, 0)}) == 8
    assert not torch.equal(draw(0, 0), draw(0, 1))
    assert not torch.equal(draw(0, 0), draw(1, 0))


def test_partition_stays_what_it_was():
    """Trained policies are stored without their partition: another draw would break them all."""
    branch = dendritic_partition(Streams(0).sequence("dendrite mask", 0), 2, 10, 2)
    assert branch.tolist() == PINNED


PINNED = [[1, 1, 0, 1, 0, 1, 0, 1, 0, 0], [0, 1, 1, 0, 1, 0, 1, 0, 0, 1]]


def test_branch_weights():
    """Each weight once, at its own branch; its gradient comes from there."""
    for branches in (2, 3):
        module = synapse(branches=branches)
        masks = torch.stack([module.branch == index for index in range(branches)])
        expanded = module.branch_weights()
        assert torch.equal(expanded, (masks * module.weight).flatten(0, 1))
        weights = torch.randn(expanded.shape)
        expanded.backward(weights)
        assert torch.equal(module.weight.grad, (masks * weights.unflatten(0, (branches, -1))).sum(0))


@pytest.mark.parametrize("bias", ["neuron", "branch"])
@pytest.mark.parametrize("branches", [1, 2, 3])
def test_input_currents_by_hand(branches, bias):
    """Each neuron's largest branch, with the bias after the max or inside it [P, ``Inter``]."""
    module = synapse(branches=branches, bias=bias).double()
    spikes = (torch.rand(2, 4, 12) < 0.5).double()
    found = module(spikes)
    weight, offset = module.weight.detach(), module.bias.detach()
    for tau, sample, neuron in np.ndindex(2, 4, 6):
        currents = []
        for branch in range(branches):
            inputs = [i for i in range(12) if module.branch is None or module.branch[neuron, i] == branch]
            currents.append(sum(float(weight[neuron, i] * spikes[tau, sample, i]) for i in inputs))
            if bias == "branch" and branches > 1:
                currents[-1] += float(offset[branch, neuron])
        after = 0.0 if bias == "branch" and branches > 1 else float(offset[neuron])
        assert float(found[tau, sample, neuron]) == pytest.approx(max(currents) + after)


def test_maxout_identity_and_ties():
    """max(a, b) = (a + b) / 2 + |a - b| / 2; of equal branches the first takes the gradient."""
    a, b = torch.randn(2, 50, 8, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    largest = maxout(torch.stack([a, b], dim=1))
    torch.testing.assert_close(largest, (a + b) / 2 + (a - b).abs() / 2)
    equal = torch.full((5, 1, 3, 40), 0.6, requires_grad=True)
    maxout(equal).sum().backward()
    assert equal.grad[:, :, 0].all() and not equal.grad[:, :, 1:].any()


def test_initial_distribution():
    """U(-1/sqrt(n), 1/sqrt(n)), PyTorch's default for Linear; ``init_fan_in=branch`` takes n / d."""
    layer = synapse(inputs=100, neurons=200)
    assert 0.099 < layer.weight.abs().max() <= 0.1
    assert layer.weight.std().item() == pytest.approx(0.1 / math.sqrt(3), rel=0.02)
    assert layer.bias.abs().max() <= 0.1
    branch = synapse(inputs=100, neurons=200, init_fan_in="branch")
    torch.testing.assert_close(branch.weight, layer.weight * math.sqrt(2))


def test_lateral_weights():
    assert neighbour_offsets(2, False) == (-2, -1, 1, 2)
    assert neighbour_offsets(2, True) == (-2, -1, 0, 1, 2)
    build = lambda **options: LateralInteraction(replace(LATERAL, **options), 500, Initialiser(Streams(0), "test"))  # noqa: E731
    weight = build()()
    assert weight.shape == (4, 500)
    assert 0.049 < weight.abs().max() <= 0.05  # 0.1 / sqrt(4)
    shared = build(weights="shared", include_self=True)
    assert shared.weight.numel() == 5
    assert shared().shape == (5, 500)
    assert torch.equal(shared()[:, 0], shared()[:, 499])
    shared().sum().backward()
    assert shared.weight.grad.tolist() == [500.0] * 5
    assert build(init_scale=0.0)().abs().max() == 0


def test_decoder_by_hand():
    """Each action reads its own neurons only."""
    decoder = PopulationDecoder(2, 3, Initialiser(Streams(0), "test"))
    with torch.no_grad():
        decoder.weight.copy_(torch.tensor([[1.0, 2.0, 3.0], [10.0, 20.0, 30.0]]))
        decoder.bias.copy_(torch.tensor([0.5, -0.5]))
    spikes = torch.zeros(2, 1, 6)
    spikes[0, 0, [0, 4]] = 1
    spikes[1, 0, [0, 5]] = 1
    np.testing.assert_allclose(decoder(spikes).detach().numpy(), [[1.5, 20 * 0.5 + 30 * 0.5 - 0.5]])
    assert PopulationDecoder(1, 100, Initialiser(Streams(0), "test")).weight.abs().max() <= 0.1
