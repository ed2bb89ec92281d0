"""The literature's other actors against a loop over their equations: else a comparison is with something else."""

from __future__ import annotations

from functools import partial

import pytest
import torch

from src.actors.build import build_actor
from src.actors.dn import DNConstants, DNState, dn_step
from src.actors.spiking_layer import unroll
from src.config.schema import ConfigurationError
from src.engine.fast import unsupported_reason
from src.streams import Streams
from tests.actors import stepwise
from tests.actors.configuration import configuration

CASES = [
    ("mdcsan", "task", {}),
    ("mdcsan", "task", {"actor__reset_gradient": False, "actor__time_steps": 8}),
    ("mdcsan", "task", {"actor__dendritic__branches": 2, "actor__lateral__radius": 2}),
    ("mdcsan", "task", {"actor__output_lateral": "all", "actor__readout": "mean_membrane"}),
    ("popsan", "analog", {"encoder__input_map": "tanh"}),
    ("popsan", "deterministic", {"actor__neuron": "dn", "actor__dn__theta_u": -0.529}),
    ("ilcsan", "deterministic", {}),
    ("ilcsan", "deterministic", {"actor__output_lateral": "no_self", "actor__readout": "max_membrane"}),
    ("ilcsan", "deterministic", {"actor__output_lateral": "self_only", "actor__readout_decay": 0.7}),
    ("ilcsan", "deterministic", {"actor__output_lateral_bias": False, "actor__lateral_gradient": False}),
    ("ilcsan", "deterministic", {"actor__dendritic__branches": 2, "actor__lateral__radius": 1}),
    ("lif_san", "deterministic", {}),
    ("bptsan", "deterministic", {"encoder__input_map": "tanh"}),
]


def built(actor, encoder, **overrides):
    config = configuration(actor, encoder, **({"actor__hidden_sizes": [24, 20]} | overrides))
    module = build_actor(config, 6, 3, Streams(3))
    with torch.no_grad():  # livelier than at the start, so that every term is at work
        for layer in getattr(module, "layers", ()):
            for parameter in layer.parameters():
                parameter.mul_(2.5)
    return config, module


def observations(dtype=torch.float32):
    return torch.randn(12, 6, generator=torch.Generator().manual_seed(1), dtype=torch.float64).to(dtype)


def results(function, actor):
    raw = function()
    actor.zero_grad()
    (raw * torch.arange(1.0, 4.0, dtype=raw.dtype)).sum().backward()
    return raw.detach(), {name: p.grad.clone() for name, p in actor.named_parameters()}


@pytest.mark.parametrize("dtype", [torch.float64, torch.float32])
@pytest.mark.parametrize(("actor", "encoder", "overrides"), CASES)
def test_values_and_gradients_are_the_equations(actor, encoder, overrides, dtype):
    config, module = built(actor, encoder, **overrides)
    module = module.to(dtype)
    s = observations(dtype)
    raw, gradients = results(lambda: module(s), module)
    expected, expected_gradients = results(lambda: stepwise.raw_action(module, config, s), module)
    tolerance = 1e-10 if dtype == torch.float64 else 1e-4
    torch.testing.assert_close(raw, expected, rtol=tolerance, atol=tolerance)
    for name, gradient in gradients.items():
        scale = float(expected_gradients[name].abs().max())
        assert scale > 0, f"{name} does not learn"
        torch.testing.assert_close(gradient, expected_gradients[name], rtol=tolerance, atol=tolerance * scale)


def test_a_dynamic_neuron_by_hand():
    """Both increments come of the values before them; a spike resets v to theta_r and moves u by theta_s."""
    constants = DNConstants(0.5, 0.5, 0.5, True, True, -0.172, 0.529, 0.021, 0.132)
    x = torch.tensor([0.6, 0.2, 0.3], dtype=torch.float64).reshape(3, 1, 1)
    spikes, potentials = unroll(x, DNState.rest(x[0]), partial(dn_step, lateral=None, offsets=(), constants=constants))
    v1, u1 = 0.6, 0.0  # fires
    v, u = 0.021, u1 + 0.132
    v2, u2 = v + v * v - v - u + 0.5, u - 0.172 * v - 0.529 * u
    v3 = v2 + v2 * v2 - v2 - u2 + 0.55
    torch.testing.assert_close(potentials.flatten(), torch.tensor([v1, v2, v3], dtype=torch.float64))
    assert spikes.flatten().tolist() == [1, 0, 1]


def test_popdan_is_a_network_of_the_strength():
    config, module = built("popdan", "task")
    s = observations()
    h = torch.exp(-((s[:, :, None] - module.encoder.mean) ** 2) / (2 * module.encoder.std**2)).flatten(1)
    for weight, bias in zip(module.hidden.weights, module.hidden.biases):
        h = (h @ weight[0] + bias[0]).clamp(min=0)
    expected = (h.reshape(12, 3, 10) * module.decoder.weight).sum(-1) + module.decoder.bias
    torch.testing.assert_close(module(s), expected)
    (module(s) ** 2).sum().backward()
    assert all(p.grad.abs().max() > 0 for p in module.parameters())
    assert config.encoder.coding == "analog" and not module.layer_parameters()


@pytest.mark.parametrize(
    ("actor", "connections"),
    [
        ("popdan", 102_171),
        ("mdcsan", 102_171),
        ("lif_san", 102_171),
        ("ilcsan", 102_171 + 3 * 10 * 10 + 30),
    ],
)
def test_connections_are_counted(actor, connections):
    """PopSAN's on Hopper, and what is added to it."""
    config = configuration(actor, "task")
    assert build_actor(config, 11, 3, Streams(0)).connection_count() == connections


@pytest.mark.parametrize(("connected", "number"), [("all", 300), ("no_self", 270), ("self_only", 30)])
def test_only_the_connections_that_there_are_exist(connected, number):
    _, module = built("ilcsan", "deterministic", actor__output_lateral=connected)
    lateral = module.layers[-1].output_lateral
    assert lateral.weight.numel() == number == int((lateral.matrix() != 0).sum())
    assert all(layer.output_lateral is None for layer in list(module.layers)[:-1])


@pytest.mark.parametrize("actor", ["mdcsan", "ilcsan", "lif_san"])
def test_health_is_theirs_too(actor):
    _, module = built(actor, "task" if actor == "mdcsan" else "deterministic")
    raw, health = module.forward_with_health(observations())
    assert torch.equal(raw, module(observations())) and len(health.layers) == 3
    assert all(0 < float(layer.firing_rate) < 1 and 0 <= float(layer.window_share) <= 1 for layer in health.layers)
    assert 0 < float(health.input_firing_rate) < 1


@pytest.mark.parametrize(
    ("actor", "encoder", "overrides", "words"),
    [
        ("popdan", "task", {}, "PopulationMLPActor"),
        ("popsan", "analog", {}, "analog input"),
        ("popsan", "deterministic", {"actor__neuron": "dn"}, "clif"),
        ("popsan", "deterministic", {"actor__output_lateral": "all"}, "output population"),
        ("popsan", "deterministic", {"actor__readout": "last_membrane"}, "membrane readouts"),
        ("popsan", "deterministic", {"encoder__input_map": "tanh"}, "input_map=tanh"),
    ],
)
def test_the_engine_says_what_it_does_not_compute(actor, encoder, overrides, words):
    assert words in unsupported_reason(built(actor, encoder, **overrides)[1])


def test_the_engine_serves_plain_lif_neurons():
    assert unsupported_reason(built("lif_san", "deterministic")[1]) is None


@pytest.mark.parametrize(
    ("actor", "encoder", "overrides", "words"),
    [
        ("mdcsan", "poisson", {}, "encoder=poisson: actor mdcsan takes the stimulation strength itself"),
        ("popdan", "deterministic", {}, "encoder=deterministic: actor popdan takes the stimulation strength itself"),
        ("aan", "analog", {}, "encoder=analog: actor aan takes no spikes"),
        (
            "ilcsan",
            "task",
            {"actor__lateral__radius": 2, "actor__dendritic__output_topology": True},
            "actor.output_lateral: all and actor.dendritic.output_topology=true",
        ),
        ("ilcsan", "task", {"actor__output_lateral": "no_self", "actor__output_population": 1}, "no_self needs"),
    ],
)
def test_what_has_no_meaning_is_refused_in_one_sentence(actor, encoder, overrides, words):
    with pytest.raises(ConfigurationError, match=words) as error:
        configuration(actor, encoder, **overrides)
    assert "\n" not in str(error.value)
