"""The bound spiking actor against the plain modules: if these fail, what trains is not what is read."""

from __future__ import annotations

import copy
import pickle

import pytest
import torch

from src.engine.flat import FlatParameters
from src.engine.spiking import BoundSpikingActor
from tests.engine.actors import ACTION_SIZE, OBSERVATION_SIZE, actor, autograd, exact

OPTIONS = {
    "output_topology": {"actor__dendritic__output_topology": True},
    "branch_bias": {"actor__dendritic__bias": "branch"},
    "three_branches": {"actor__dendritic__branches": 3},
    "three_branches_with_biases": {"actor__dendritic__branches": 3, "actor__dendritic__bias": "branch"},
    "shared_lateral": {"actor__lateral__weights": "shared", "actor__lateral__include_self": True},
    "detached": {"actor__reset_gradient": False, "actor__lateral_gradient": False},
    "detached_reset": {"actor__reset_gradient": False},
    "detached_lateral": {"actor__lateral_gradient": False},
    "fixed_encoder": {"encoder__learnable": False},
    "one_step": {"actor__time_steps": 1, "actor__threshold": 0.05},
    "widths": {"actor__hidden_sizes": [33, 70, 17], "actor__threshold": 0.1},
    "radius_1": {"actor__lateral__radius": 1},
    "radius_1_and_self": {"actor__lateral__radius": 1, "actor__lateral__include_self": True},
    "radius_3": {"actor__lateral__radius": 3},
    "radius_of_the_layer": {"actor__lateral__radius": 19, "actor__hidden_sizes": [30, 20]},
    "one_layer": {"actor__hidden_sizes": [64], "actor__output_population": 1},
}


def bind(built):
    flat = FlatParameters(built.parameters())
    return BoundSpikingActor(built), flat


def draws():
    return torch.Generator().manual_seed(3)


def assert_serves(built, batch):
    """Values, health and gradients of a pass are the plain modules'."""
    bound, flat = bind(exact(built))
    observation = torch.randn(batch, OBSERVATION_SIZE)
    grad_raw = torch.linspace(-1, 1, batch * ACTION_SIZE).view(batch, ACTION_SIZE)
    expected, expected_health, gradients = autograd(built, observation, grad_raw, draws())
    (raw,), health, vjp_fn = bound.vjp(observation.unsqueeze(0), draws(), True)
    assert torch.equal(raw, expected)
    assert health == expected_health
    flat.gradient.fill_(torch.nan)
    vjp_fn(grad_raw)
    for parameter, gradient in gradients.items():
        found = parameter.grad
        torch.testing.assert_close(found, gradient, rtol=1e-4, atol=1e-5 * float(gradient.abs().max()))
    assert torch.equal(bound.raw_action(observation, draws()), expected)
    assert torch.equal(bound.raw(observation.unsqueeze(0), draws())[0], expected)
    return gradients


@pytest.mark.parametrize("encoder", ["poisson", "deterministic"])
@pytest.mark.parametrize("name", ["popsan", "bptsan_wo_ndt", "bptsan_wo_li", "bptsan"])
@pytest.mark.parametrize("batch", [1, 10, 100])
def test_passes_and_gradients_are_the_plain_modules(batch, name, encoder):
    gradients = assert_serves(actor(name, encoder), batch)
    assert all(gradient.abs().sum() > 0 for gradient in list(gradients.values())[-2:])


@pytest.mark.parametrize("option", OPTIONS)
def test_every_option_is_served(option):
    assert_serves(actor("bptsan", **OPTIONS[option]), 7)


@pytest.mark.parametrize("encoder", ["poisson", "deterministic"])
@pytest.mark.parametrize("name", ["popsan", "bptsan"])
def test_grouping_passes_moves_no_number(name, encoder):
    """Each minibatch draws its own chance: three at once are three one after the other, in values and gradients."""
    bound, flat = bind(exact(actor(name, encoder)))
    observation, grad_raw = torch.randn(3, 20, OBSERVATION_SIZE), torch.randn(20, ACTION_SIZE)
    together, alone = draws(), draws()
    raw, health, vjp_fn = bound.vjp(observation, together, True)
    raw = raw.clone()
    vjp_fn(grad_raw)
    gradient = flat.gradient.clone()
    for index in range(2):
        assert torch.equal(bound.raw(observation[index : index + 1], alone)[0], raw[index])
    (last,), last_health, vjp_fn = bound.vjp(observation[2:], alone, True)
    assert torch.equal(last, raw[2]) and last_health == health
    assert torch.equal(together.get_state(), alone.get_state())
    vjp_fn(grad_raw)
    torch.testing.assert_close(flat.gradient, gradient, rtol=1e-4, atol=1e-6)


@pytest.mark.parametrize("how", ["step", "edit", "load"])
def test_acting_follows_the_parameters(how):
    """Branch weights of earlier parameters would be half of an old policy."""
    built, other = exact(actor("bptsan")), exact(actor("bptsan"))
    bound, flat = bind(built)
    observation = torch.randn(4, OBSERVATION_SIZE)
    before = bound.raw_action(observation, None).clone()
    with torch.no_grad():
        if how == "step":  # the engine's own optimizer writes to the flat tensor
            flat.values.mul_(-1)
        elif how == "edit":
            built.layers[0].synapse.weight.mul_(-1)
        else:
            for parameter in other.parameters():
                parameter.mul_(-1)
            built.load_state_dict(other.state_dict())
        assert torch.equal(bound.raw_action(observation, None), built(observation))
    assert not torch.equal(bound.raw_action(observation, None), before)


def test_a_copy_would_hold_the_addresses_of_the_original():
    bound, _ = bind(actor("bptsan"))
    for duplicate in (copy.deepcopy, pickle.dumps):
        with pytest.raises(TypeError, match="build another learner"):
            duplicate(bound)


def test_buffers_are_bounded_however_many_sizes_come():
    bound, _ = bind(actor("popsan"))
    for samples in range(1, 60):
        bound.raw_action(torch.zeros(samples, OBSERVATION_SIZE), None)
    assert len(bound._workspaces) <= 6


def test_every_buffer_begins_at_a_cache_line():
    """A library may give other bits at another alignment: a resumed run would not be the run."""
    bound, _ = bind(actor("bptsan"))
    bound.vjp(torch.zeros(3, 7, OBSERVATION_SIZE), None, False)
    (workspace,) = bound._workspaces.values()
    addresses = [trace[name] for trace in workspace.traces for name in trace.dtype.names]
    addresses += [workspace.passes[name][0] for name in ("input_spikes", "rates", "grad_strength")]
    assert all(address % 64 == 0 for address in addresses)


def test_passes_of_other_sizes_do_not_disturb_each_other():
    bound, flat = bind(exact(actor("bptsan")))
    one, other = torch.randn(1, 20, OBSERVATION_SIZE), torch.randn(1, 7, OBSERVATION_SIZE)
    grad_raw = torch.randn(20, ACTION_SIZE)
    _, _, vjp_fn = bound.vjp(one, None, False)
    vjp_fn(grad_raw)
    expected = flat.gradient.clone()
    _, _, vjp_fn = bound.vjp(one, None, False)
    bound.raw(other, None)
    bound.raw_action(one[0], None)
    vjp_fn(grad_raw)
    assert torch.equal(flat.gradient, expected)


def test_strided_observations_and_gradients_are_read_as_they_are():
    bound, flat = bind(exact(actor("bptsan")))
    observation, grad_raw = torch.randn(OBSERVATION_SIZE, 6), torch.randn(ACTION_SIZE, 6)
    raw, _, vjp_fn = bound.vjp(observation.t().contiguous().unsqueeze(0), None, False)
    vjp_fn(grad_raw.t().contiguous())
    expected, gradient = raw.clone(), flat.gradient.clone()
    raw, _, vjp_fn = bound.vjp(observation.t().unsqueeze(0), None, False)
    vjp_fn(grad_raw.t())
    assert torch.equal(raw, expected) and torch.equal(flat.gradient, gradient)


def test_what_would_read_beyond_an_array_is_refused():
    bound, _ = bind(actor("bptsan"))
    with pytest.raises(ValueError, match=r"12 columns of torch\.float32, the encoder takes 11"):
        bound.raw(torch.zeros(1, 2, 12), None)
    with pytest.raises(ValueError, match=r"torch.float64"):
        bound.raw_action(torch.zeros(2, OBSERVATION_SIZE).double(), None)
    _, _, vjp_fn = bound.vjp(torch.zeros(1, 2, OBSERVATION_SIZE), None, False)
    for wrong in (torch.zeros(3, 3), torch.zeros(2, 3).double()):
        with pytest.raises(ValueError, match=r"raw action is \[2, 3\], float32"):
            vjp_fn(wrong)
    poisson, _ = bind(actor("bptsan", "poisson"))
    with pytest.raises(ValueError, match="generator"):
        poisson.raw(torch.zeros(1, 2, OBSERVATION_SIZE), None)
