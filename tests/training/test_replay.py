"""Nothing that was experienced may be lost, doubled or sampled more than its share, and a full disk must say so."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import torch
from torchrl.data.replay_buffers import ReplayBuffer

from src.training.checkpoint import CorruptState
from src.training.collection import Transitions
from src.training.replay import Replay, TransitionLog, sample_minibatches
from tests.helpers import ROOT

N, M = 5, 2


def block(start: int, length: int, n: int = N, m: int = M) -> Transitions:
    """Transitions whose every number tells which one, and which field, it is."""
    number = torch.arange(start, start + length, dtype=torch.float32)
    observation = number[:, None] + torch.arange(n) / 1000
    return Transitions(
        observation=observation,
        action=-number[:, None] - torch.arange(m) / 1000,
        reward=2 * number,
        next_observation=observation + 0.5,
        terminated=(number % 7 == 0).float(),
        truncated=(number % 11 == 0).float(),
        finished=[],
    )


def replay(path: Path, rows: int = 1000, capacity: int = 1000, seed: int = 0) -> Replay:
    return Replay(TransitionLog(path / "replay.bin", rows, N, M), capacity, torch.Generator().manual_seed(seed))


def numbers(buffer: Replay, draws: int = 20_000) -> torch.Tensor:
    """Which transitions are sampled."""
    return (sample_minibatches(buffer, 1, draws).reward / 2).long().flatten()


def test_what_is_sampled_is_what_was_stored(tmp_path: Path) -> None:
    buffer = replay(tmp_path)
    assert isinstance(buffer, ReplayBuffer)
    for start in range(0, 500, 50):
        buffer.extend(block(start, 50))
    assert len(buffer) == buffer.write_count == 500
    found = sample_minibatches(buffer, 50, 100)
    assert [tuple(tensor.shape) for tensor in found] == [(50, 100, N), (50, 100, M), (50, 100), (50, 100, N), (50, 100)]
    assert all(tensor.is_contiguous() and tensor.dtype == torch.float32 for tensor in found)
    stored, index = block(0, 500), (found.reward / 2).long()
    for name in found._fields:
        assert torch.equal(getattr(found, name), getattr(stored, name)[index]), name
    assert torch.equal(buffer[torch.tensor([7])][0], stored.observation[7:8])


def test_samples_are_copies(tmp_path: Path) -> None:
    """Normalising a minibatch in place must not rewrite the past."""
    buffer = replay(tmp_path)
    buffer.extend(block(0, 10))
    for tensor in sample_minibatches(buffer, 2, 10):
        tensor.fill_(-1)
    assert numbers(buffer, 100).min() >= 0


def test_sampling_is_uniform(tmp_path: Path) -> None:
    """Chi-square over 200 transitions: 199 degrees of freedom, so 280 is beyond p = 1e-4."""
    buffer = replay(tmp_path)
    buffer.extend(block(0, 200))
    counts = torch.bincount(numbers(buffer), minlength=200).double()
    assert ((counts - 100).square() / 100).sum() < 280


def test_only_the_last_capacity_is_sampled(tmp_path: Path) -> None:
    buffer = replay(tmp_path, capacity=120)
    buffer.extend(block(0, 100))
    assert set(numbers(buffer).tolist()) == set(range(100))
    for start in range(100, 400, 50):
        buffer.extend(block(start, 50))
        assert set(numbers(buffer).tolist()) == set(range(start + 50 - 120, start + 50))


def test_the_generator_is_the_only_chance(tmp_path: Path) -> None:
    buffer = replay(tmp_path)
    buffer.extend(block(0, 300))
    state, other = buffer.generator.get_state(), torch.get_rng_state()
    first = sample_minibatches(buffer, 3, 10)
    assert torch.equal(other, torch.get_rng_state())
    assert not torch.equal(first.reward, sample_minibatches(buffer, 3, 10).reward)
    buffer.generator.set_state(state)
    assert all(torch.equal(a, b) for a, b in zip(first, sample_minibatches(buffer, 3, 10)))


def test_an_empty_replay_cannot_be_sampled(tmp_path: Path) -> None:
    with pytest.raises(RuntimeError, match="empty"):
        replay(tmp_path).sample(1)


def test_it_holds_no_more_than_its_rows(tmp_path: Path) -> None:
    buffer = replay(tmp_path, rows=100)
    buffer.extend(block(0, 100))
    with pytest.raises(IndexError, match="at most 100"):
        buffer.extend(block(100, 1))
    assert len(buffer) == 100


def test_the_file_grows_in_chunks_and_keeps_what_it_held(tmp_path: Path) -> None:
    """A row of Ant's size, so that several chunks are needed."""
    n, m, rows = 111, 8, 100_000
    buffer = Replay(TransitionLog(tmp_path / "replay.bin", rows, n, m), rows, torch.Generator().manual_seed(0))
    sizes = []
    for start in range(0, rows, 10_000):
        buffer.extend(block(start, 10_000, n, m))
        stored = (tmp_path / "replay.bin").stat()
        assert stored.st_blocks * 512 >= stored.st_size, "the file is sparse: a full disk would kill the process"
        sizes.append(stored.st_size)
    row = 4 * (2 * n + m + 2)
    assert sizes[-1] == rows * row and sizes[0] < rows * row / 2 and len(set(sizes)) > 2
    found = sample_minibatches(buffer, 10, 100)
    expected = (found.reward / 2)[..., None] + torch.arange(n) / 1000
    assert torch.equal(found.observation, expected) and torch.equal(found.next_observation, expected + 0.5)


def test_a_resumed_run_goes_back_to_its_checkpoint(tmp_path: Path) -> None:
    """Rows written after the checkpoint are written again; the end is as if nothing had happened."""
    whole, resumed = tmp_path / "whole", tmp_path / "resumed"
    whole.mkdir(), resumed.mkdir()
    straight = replay(whole)
    for start in range(0, 300, 50):
        straight.extend(block(start, 50))
    stopped = replay(resumed)
    for start in range(0, 200, 50):
        stopped.extend(block(start, 50))
    stopped.log.flush()
    stopped.extend(block(700, 33))  # after the checkpoint, and different
    again = replay(resumed)
    assert len(again) == 0
    again.log.truncate(200)
    again.extend(block(200, 100))
    assert len(again) == len(straight) == 300
    assert torch.equal(numbers(again), numbers(straight))
    assert (whole / "replay.bin").read_bytes()[: 300 * 4 * 14] == (resumed / "replay.bin").read_bytes()[: 300 * 4 * 14]


def test_an_extended_run_has_more_rows(tmp_path: Path) -> None:
    buffer = replay(tmp_path, rows=100)
    buffer.extend(block(0, 100))
    longer = replay(tmp_path, rows=250)
    longer.log.truncate(100)
    longer.extend(block(100, 150))
    assert set(numbers(longer).tolist()) == set(range(250))


@pytest.mark.parametrize("keep", [0, 1, 4 * 14 * 99 + 5])
def test_a_file_cut_short_is_noticed(tmp_path: Path, keep: int) -> None:
    buffer = replay(tmp_path, rows=100)
    buffer.extend(block(0, 100))
    with (tmp_path / "replay.bin").open("r+b") as file:
        file.truncate(keep)
    short = replay(tmp_path, rows=100)
    with pytest.raises(CorruptState, match="checkpoint counts on 100"):
        short.log.truncate(100)


def test_a_deleted_file_is_noticed(tmp_path: Path) -> None:
    with pytest.raises(CorruptState, match="deleted"):
        replay(tmp_path).log.truncate(50)


def test_a_folder_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        Replay(TransitionLog(tmp_path / "gone" / "replay.bin", 10, N, M), 10, torch.Generator())


def test_an_empty_file_can_be_flushed_too(tmp_path: Path) -> None:
    buffer = replay(tmp_path)
    buffer.log.flush()
    buffer.extend(block(0, 1000))
    buffer.log.flush()


_FILL = """
import os, resource, sys
from pathlib import Path
import torch
from src.training.replay import Replay, TransitionLog, sample_minibatches
from tests.training.test_replay import block
limit, allocation = int(sys.argv[2]), sys.argv[3]
if allocation == "by writing":
    vars(os).pop("posix_fallocate", None)
if limit:
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
buffer = Replay(TransitionLog(Path(sys.argv[1]), 200_000, 111, 8), 200_000, torch.Generator())
try:
    while True:
        buffer.extend(block(len(buffer), 1000, 111, 8))
except OSError as error:
    print(error)
assert len(buffer) >= 30_000, len(buffer)
found = sample_minibatches(buffer, 50, 100)
assert torch.equal(found.observation[..., 0], found.reward / 2)
buffer.log.flush()
assert Path(sys.argv[1]).stat().st_size >= len(buffer) * 4 * 232
"""
#: How the file grows; macOS has only the second.
ALLOCATIONS = ["by the system", "by writing"]


def assert_a_reason_not_a_death(result: subprocess.CompletedProcess[str], reason: str) -> None:
    """A sparse memory map would be killed by SIGBUS; what was stored before stays readable."""
    assert result.returncode == 0, result.stderr
    assert "no space for the replay to grow" in result.stdout and "replay.bin" in result.stdout
    assert reason in result.stdout


@pytest.mark.parametrize("allocation", ALLOCATIONS)
def test_a_file_size_limit_is_an_error_with_a_reason(tmp_path: Path, allocation: str) -> None:
    command = [sys.executable, "-c", _FILL, str(tmp_path / "replay.bin"), str(60 * 2**20), allocation]
    result = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, timeout=600)
    assert_a_reason_not_a_death(result, "File too large")


@pytest.mark.parametrize("allocation", ALLOCATIONS)
def test_a_full_disk_is_an_error_with_a_reason(tmp_path: Path, allocation: str) -> None:
    """A real one: a small tmpfs in a mount namespace of its own, gone when the process is."""
    own_mounts = ["unshare", "--mount", "--map-root-user"]
    mount = 'mount -t tmpfs -o size=60m none "$1"'
    if shutil.which("unshare") is None or subprocess.run([*own_mounts, "sh", "-c", mount, "_", tmp_path]).returncode:
        pytest.skip("no mount namespaces here")
    fill = [sys.executable, "-c", _FILL, str(tmp_path / "replay.bin"), "0", allocation]
    command = [*own_mounts, "sh", "-c", mount + ' && shift && exec "$@"', "_", str(tmp_path), *fill]
    result = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, timeout=600)
    assert_a_reason_not_a_death(result, "No space left on device")
