"""What every kernel is compiled with."""

from __future__ import annotations

from numba import float32, void

from src.actors.kernels import disjoint


def test_llvm_knows_that_arrays_do_not_overlap() -> None:
    def add(target, a):
        for j in range(target.shape[0]):
            target[j] = target[j] + a[j]

    compiled = disjoint(add)
    signature = void(float32[::1], float32[::1])
    compiled.compile(signature.args)
    (code,) = compiled.inspect_llvm().values()
    assert "<8 x float>" in code or "<4 x float>" in code or "<16 x float>" in code  # SIMD
    assert "vector.memcheck" not in code  # and no looking for overlaps first
