"""The random streams of a run are what they were: otherwise no run of an earlier version can be reproduced."""

from __future__ import annotations

import pytest
import torch

from src.streams import Streams

#: Seed 7: the first three draws below 2**31 of each stream, and its integer seed.
PINNED = {
    "exploration": ([1165921198, 60543804, 1208920820], 373863875),
    "target noise": ([793506950, 1383675656, 1027553055], 551770931),
    "policy noise": ([1552626616, 1840622968, 1365257661], 1464946476),
    "encoder": ([1930743745, 389320588, 2070164809], 498699948),
    "random actions": ([1247959160, 3270463, 1108724142], 1828182328),
    "replay": ([1213845188, 552964911, 885264806], 936609531),
    "evaluation": ([1642786210, 1537449723, 936532099], 866171057),
}


@pytest.mark.parametrize("name", PINNED)
def test_the_streams_of_a_run_stay_what_they_were(name: str) -> None:
    generator = Streams(7).torch(name)
    found = torch.randint(2**31, (3,), generator=generator).tolist(), Streams(7).integer(name)
    assert found == PINNED[name]


def test_a_stream_depends_on_its_name_and_seed_alone() -> None:
    first = Streams(0)
    expected = torch.rand(4, generator=Streams(0).torch("replay"))
    torch.rand(100, generator=first.torch("encoder"))
    assert torch.equal(torch.rand(4, generator=first.torch("replay")), expected)
    for other in (Streams(1).torch("replay"), first.torch("replay", 0), first.torch("encoder")):
        assert not torch.equal(torch.rand(4, generator=other), expected)


def test_numpys_generators_are_reproducible() -> None:
    assert Streams(0).numpy("a", 1).integers(2**62) == Streams(0).numpy("a", 1).integers(2**62)
    assert Streams(0).numpy("a", 1).integers(2**62) != Streams(0).numpy("a", 2).integers(2**62)
