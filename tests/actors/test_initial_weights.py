"""Parameter names and initial weights are what they were: a seed gives the run that it gave, a policy file loads.

Each parameter draws from the stream of its own name, so that actors share the weights of the parts that they share.
"""

from __future__ import annotations

import pytest
import torch
from torch import nn

from src.actors.build import build_actor
from src.actors.mlp import MLP
from src.algorithms.networks import TwinCritic
from src.streams import Streams
from tests.actors.configuration import configuration

#: By name of the parameter, for Hopper's sizes and seed 0: first and last value, and sum.
AAN = {
    "hidden.weights.0": (-0.03098912, 0.26509210, -5.080930),
    "hidden.weights.1": (0.04700632, -0.02271514, -8.192854),
    "hidden.biases.0": (-0.21074201, -0.21475466, 5.158626),
    "hidden.biases.1": (0.01917603, 0.01585557, 0.218223),
    "output.weights.0": (0.02350947, 0.05190648, 1.069274),
    "output.biases.0": (-0.00819054, 0.05451081, 0.090719),
}
SPIKING = {
    "encoder.mean": (-3.00000000, 3.00000000, 0.000000),
    "encoder.std": (0.38729835, 0.38729835, 42.602818),
    "layers.0.synapse.weight": (0.09040326, -0.02446291, -2.917405),
    "layers.0.synapse.bias": (-0.04944608, -0.02436953, 0.518239),
    "layers.0.lateral.weight": (0.03846971, -0.04163879, -0.240414),
    "layers.1.synapse.weight": (-0.04825638, -0.00051073, -5.148478),
    "layers.1.synapse.bias": (0.01388183, 0.05711091, 0.055192),
    "layers.1.lateral.weight": (-0.03328450, -0.02619663, -2.388272),
    "layers.2.synapse.weight": (0.01496262, -0.01123116, 2.168684),
    "layers.2.synapse.bias": (-0.03908817, -0.00711382, 0.063516),
    "decoder.weight": (0.20076746, -0.10281245, -0.345326),
    "decoder.bias": (0.17270815, -0.04784574, -0.137400),
}
CRITIC = {
    "networks.weights.0": (-0.15215729, 0.04274675, 9.425331),
    "networks.weights.1": (-0.01717015, -0.02584486, -6.041861),
    "networks.weights.2": (0.02419256, -0.03025915, 0.782294),
    "networks.biases.0": (-0.10636283, -0.12619461, -4.463780),
    "networks.biases.1": (-0.06146704, 0.03498440, -0.741384),
    "networks.biases.2": (0.03857967, 0.05366293, 0.092243),
}
LOG_STD = {
    "network.weights.0": (0.14299786, -0.08714775, -1.247338),
    "network.weights.1": (0.02007250, -0.04233686, -16.712778),
    "network.weights.2": (0.02160908, -0.02154260, 0.551743),
    "network.biases.0": (-0.01975975, 0.13967712, 4.574976),
    "network.biases.1": (0.03845866, -0.04243812, -0.467201),
    "network.biases.2": (0.02717705, -0.03588057, -0.048812),
}
LOG_STD_HEAD = {
    "network.weights.0": (0.02964189, -0.00178120, 0.608527),
    "network.biases.0": (-0.00409598, 0.04253875, 0.024584),
}


def assert_pinned(module: nn.Module, pinned: dict[str, tuple[float, float, float]]) -> None:
    state = module.state_dict()
    assert set(state) == set(pinned)
    for name, value in state.items():
        flat = value.double().flatten()
        found = float(flat[0]), float(flat[-1]), float(flat.sum())
        assert found == pytest.approx(pinned[name], rel=1e-5, abs=1e-6), name


@pytest.mark.parametrize("actor", ["popsan", "bptsan", "bptsan_wo_ndt", "bptsan_wo_li"])
def test_spiking_actors_start_from_the_same_weights(actor: str) -> None:
    lateral = actor in ("bptsan", "bptsan_wo_ndt")
    pinned = {name: values for name, values in SPIKING.items() if lateral or ".lateral." not in name}
    assert_pinned(build_actor(configuration(actor), 11, 3, Streams(0)), pinned)


def test_the_other_networks_start_from_the_same_weights() -> None:
    assert_pinned(build_actor(configuration("aan", "task"), 11, 3, Streams(0)), AAN)
    assert_pinned(TwinCritic(11, 3, (256, 256), Streams(0)), CRITIC)
    assert_pinned(MLP((11, 256, 256, 3), Streams(0), "log_std"), LOG_STD)
    assert_pinned(MLP((256, 3), Streams(0), "log_std"), LOG_STD_HEAD)


def test_other_seeds_start_elsewhere() -> None:
    first, second = (TwinCritic(11, 3, (256, 256), Streams(seed)) for seed in (0, 1))
    assert not any(torch.equal(a, b) for a, b in zip(first.parameters(), second.parameters(), strict=True))
