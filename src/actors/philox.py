"""Uniform numbers from a counter: Philox4x32-10 of Salmon, Moraes, Dror and Shaw (SC 2011), in plain PyTorch.

A 64-bit key and a 128-bit counter give four words of 32 bits; the numbers can be computed in any order, on any device,
and are the same.
"""

from __future__ import annotations

import torch
from torch import Tensor

ROUNDS = 10
MULTIPLIERS = (0xD2511F53, 0xCD9E8D57)
WEYL = (0x9E3779B9, 0xBB67AE85)  # added to the halves of the key after each round
MASK = 0xFFFFFFFF


def draw_key(generator: torch.Generator) -> int:
    """A key in 0..2**64-1: one draw from a generator, which moves on by it."""
    draw = torch.empty((), dtype=torch.int64, device=generator.device).random_(-(2**63), None, generator=generator)
    return int(draw) & (2**64 - 1)


def philox(counter: tuple[Tensor, Tensor, Tensor, Tensor], key: int) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """Four words of each counter; counters and words are int64 tensors of one shape with values in 0..2**32-1."""
    c0, c1, c2, c3 = counter
    k0, k1 = key & MASK, key >> 32
    for _ in range(ROUNDS):
        first, second = MULTIPLIERS[0] * c0, MULTIPLIERS[1] * c2  # the 64 bits are right, whatever their sign
        c0, c1 = (second >> 32) & MASK ^ c1 ^ k0, second & MASK
        c2, c3 = (first >> 32) & MASK ^ c3 ^ k1, first & MASK
        k0, k1 = (k0 + WEYL[0]) & MASK, (k1 + WEYL[1]) & MASK
    return c0, c1, c2, c3


def uniform(key: int, steps: int, count: int, device: torch.device) -> Tensor:
    """Uniform numbers in [0, 1) of 24 bits, ``[steps, count]``, float32.

    The counter is ``(q, step, 0, 0)`` with q in ``0..Q-1``, ``Q = ceil(count / 4)``; its word w is number ``w Q + q``.
    """
    quarter = (count + 3) // 4
    zeros = torch.zeros(steps, quarter, dtype=torch.int64, device=device)
    q = torch.arange(quarter, device=device).expand_as(zeros)
    step = torch.arange(steps, device=device).unsqueeze(1).expand_as(zeros)
    words = torch.cat(philox((q, step, zeros, zeros), key), dim=1)[:, :count]
    return (words >> 8).to(torch.float32) * 2.0**-24
