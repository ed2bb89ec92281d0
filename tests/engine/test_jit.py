"""The cache of machine code: if these fail, stale code trains in silence, or a read-only checkout can't train."""

from __future__ import annotations

import numpy as np
from numba import float32, void

from src.engine import jit


def test_the_cache_folder_goes_by_every_source_of_the_engine(tmp_path, monkeypatch):
    (tmp_path / "one.py").write_text("a = 1\n")
    (tmp_path / "other.py").write_text("b = 1\n")
    monkeypatch.setattr(jit, "__file__", str(tmp_path / "jit.py"))
    monkeypatch.setattr(jit._settings, "CACHE_DIR", "")
    folder = jit.cache_folder.__wrapped__
    before = folder()
    assert before.parent == tmp_path / "__pycache__" and folder() == before
    (tmp_path / "other.py").write_text("b = 2\n")
    assert folder() != before


def test_numbas_own_setting_says_where_the_cache_lies(tmp_path, monkeypatch):
    monkeypatch.setattr(jit._settings, "CACHE_DIR", str(tmp_path / "cache"))
    assert jit.cache_folder.__wrapped__().parent == tmp_path / "cache"


def double(x):
    """Doubles in place."""
    for i in range(x.shape[0]):
        x[i] = x[i] * np.float32(2)


def test_where_no_cache_can_be_written_kernels_compile_all_the_same(tmp_path, monkeypatch):
    blocked = tmp_path / "file"
    blocked.write_text("no folder")
    monkeypatch.setattr(jit, "cache_folder", lambda: blocked / "kernels")
    monkeypatch.setattr(jit, "KERNELS", {})
    kernel = jit.kernel(void(float32[::1]))(double)
    x = np.ones(3, np.float32)
    kernel(x)
    assert x.tolist() == [2, 2, 2]
    assert kernel in jit.KERNELS.values()
