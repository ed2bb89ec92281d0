"""What is remembered of where parameters lie, and when it must not be."""

from __future__ import annotations

import copy
import pickle
from typing import Any

import pytest
import torch

from src.algorithms import learner as learners
from src.ensemble_mlp import EnsembleMLP
from src.places import Places, fixed_places
from tests.actors.vjp import gradients
from tests.algorithms.test_learners import make_burst, make_learner


class Found:
    """A look-up's result."""

    def __init__(self, about: object, copied: bool = False) -> None:
        self.about, self.copied = about, copied


def values(about: object) -> Found:
    return Found(about, copied=True)


def test_remembers_within_only_by_identity_and_never_copies() -> None:
    places, one, other = Places(), [1], [1]
    assert places.once(Found, one) is not places.once(Found, one)
    with places.fixed():
        first = places.once(Found, one)
        assert places.once(Found, one) is first and places.once(Found, other).about is other
        assert places.once(values, one) is not places.once(values, one)
        with places.fixed():  # what is found here may be another thing, and is forgotten
            inner = places.once(Found, one)
            assert inner is not first and places.once(Found, one) is inner
        assert places.once(Found, one) is first
        for twin in (copy.deepcopy(places), pickle.loads(pickle.dumps(places))):  # within nothing
            assert twin.once(Found, one) is not twin.once(Found, one)
    assert places.once(Found, one) is not first
    with pytest.raises(KeyError), places.fixed():
        places.once(Found, one)
        raise KeyError
    assert places.once(Found, one) is not places.once(Found, one)


def test_an_object_made_anew_in_the_place_of_another_is_another() -> None:
    places = Places()
    with places.fixed():
        assert all(places.once(sum, [index]) == index for index in range(100))  # a sum keeps no list alive


def test_every_network_of_a_module_remembers() -> None:
    actor = make_learner("td3", "aan", "task").policy.actor
    networks = [actor, *(m for m in actor.modules() if isinstance(m, EnsembleMLP))]
    with fixed_places(actor):
        for network in networks:
            assert network.places.once(Found, network) is network.places.once(Found, network)
    assert len(networks) == 3


@pytest.mark.parametrize(
    ("actor", "lateral"),
    [
        ("bptsan", "per_neuron"),
        ("bptsan", "shared"),  # of this and those that are transposed the kernels take copies
        ("bptsan", "transposed"),
        ("aan", "none"),
        ("aan", "transposed"),
    ],
)
def test_values_may_change_while_places_are_fixed_and_places_afterwards(actor: str, lateral: str) -> None:
    options = {"actor.lateral.weights": "shared" if lateral == "shared" else "per_neuron"} if actor == "bptsan" else {}
    built = make_learner("td3", actor, "deterministic" if options else "task", **options).policy.actor
    observation, to_raw = torch.randn(6, 5), torch.randn(6, 3)
    if lateral == "transposed":
        for name, parameter in built.named_parameters():
            if "weight" in name and "lateral" not in name:
                parameter.data = parameter.data.transpose(0, -1).contiguous().transpose(0, -1)

    def check() -> None:
        """Against a copy, which has nothing to remember; acting, acting with fixed weights, learning."""
        plain = copy.deepcopy(built)
        expected = gradients(plain, observation, to_raw)
        with torch.no_grad():
            assert torch.equal(built(observation), expected[0])
            with built.fixed_weights():
                assert torch.equal(built(observation), expected[0])
        for ours, theirs in zip(gradients(built, observation, to_raw), expected, strict=True):
            assert torch.equal(ours, theirs)

    for _ in range(2):
        with fixed_places(built):
            for _ in range(2):
                check()
                with torch.no_grad():
                    for parameter in built.parameters():
                        parameter.mul_(1.1)
        for parameter in built.parameters():
            parameter.data = 0.9 * parameter.data
    with built.fixed_weights():
        check()


@pytest.mark.parametrize("algo", ["td3", "sac"])
@pytest.mark.parametrize("actor", ["bptsan", "popsan", "aan"])
def test_a_burst_gives_the_same_numbers_with_and_without(
    algo: str, actor: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    once, kept = Places.once, []

    def noted(self: Places, *arguments: Any) -> Any:
        kept.append(self._kept is not None)
        return once(self, *arguments)

    monkeypatch.setattr(Places, "once", noted)
    results = []
    for remembers in (True, False):
        if not remembers:
            monkeypatch.setattr(learners, "fixed_places", lambda *_: fixed_places())
        learner = make_learner(algo, actor, "task")
        kept.clear()
        for seed in (1, 2):
            learner.update(make_burst(seed, count=4))
        assert set(kept) == {remembers}
        results.append([flat.values for flat in learner.flat.values()])
    for one, other in zip(*results, strict=True):
        assert torch.equal(one, other)
