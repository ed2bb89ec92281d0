"""Memory inside kernels: arrays at addresses, and scratch buffers that begin at cache lines."""

from __future__ import annotations

import numpy as np
from numba import carray, int64

from src.engine.jit import FLOAT, LINE, bytes_at, floats_at, inner


@inner
def floats(address, shape):  # type: ignore[no-untyped-def]
    """The float32 array of that shape at an address."""
    return carray(floats_at(address), shape)


@inner
def bytes_(address, shape):  # type: ignore[no-untyped-def]
    """The int8 array of that shape at an address."""
    return carray(bytes_at(address), shape)


@inner
def aligned(count):  # type: ignore[no-untyped-def]
    """``count`` uninitialised floats that begin at a cache line."""
    memory = np.empty(count + LINE // FLOAT, np.float32)
    start = -int64(memory.ctypes.data) % LINE // FLOAT
    return memory[start : start + count]


@inner
def next_line(address):  # type: ignore[no-untyped-def]
    """The first multiple of a cache line from there on."""
    return (address + LINE - 1) // LINE * LINE


@inner
def keep_alive(array):  # type: ignore[no-untyped-def]
    """Numba frees an array after its last mention: one that is used by its address is mentioned after that."""
    return array.shape[0]
