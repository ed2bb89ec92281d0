"""Real runs in processes of their own: ``python -m src.run``, and the same in a fork that finds torch loaded.

A start of Python with torch and TorchRL takes seconds, a run of these tests less. So most starts are forks of
multiprocessing's fork server, which has loaded the libraries; the fork runs ``src.run`` as ``__main__``.
"""

from __future__ import annotations

import ctypes
import json
import multiprocessing
import os
import resource
import runpy
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import torch

from src.experiment.run_directory import FILES
from src.training.checkpoint import read_archive

ROOT = Path(__file__).resolve().parents[2]
TINY = (
    "protocol.total_steps=450",
    "protocol.start_steps=150",
    "protocol.update_after=100",
    "protocol.evaluation_interval=150",
    "protocol.evaluation_episodes=2",
    "protocol.checkpoint_interval=50",
    "algo.batch_size=16",
    "algo.critic_hidden_sizes=[32,32]",
    "actor.hidden_sizes=[32,32]",
    "env.max_episode_steps=60",
    "logger=none",
    "study=test",
    "label=tiny",
)
AAN = ("actor=aan", *TINY)
KILL = signal.SIGKILL
_FORKS = multiprocessing.get_context("forkserver")
_FORKS.set_forkserver_preload(["tests.end_to_end.preload"])


class Forked:
    """``python -m src.run arguments results_dir=results`` in a fork; ``prepare`` is called in it first."""

    def __init__(self, results: Path, *arguments: str, prepare: Callable[[], None] | None = None) -> None:
        results.mkdir(parents=True, exist_ok=True)
        self.results = results
        self._output = results / "output.txt"
        argv = [*arguments, f"results_dir={results}"]
        self._process = _FORKS.Process(target=run_here, args=(argv, self._output, prepare))
        self._process.start()
        self.pid = self._process.pid
        self.at_gate: Callable[[], bool] = lambda: False  # whether it waits where no more can be waited for

    def signal(self, number: int) -> None:
        assert self.pid is not None
        if self.alive:
            os.kill(self.pid, number)

    @property
    def alive(self) -> bool:
        return self._process.is_alive()

    def wait(self, timeout: float = 240) -> int:
        """The exit code; negative for a signal."""
        self._process.join(timeout)
        if self._process.exitcode is None:
            self._process.kill()
            raise AssertionError(f"not ended after {timeout} s: {self.output}")
        return self._process.exitcode

    @property
    def output(self) -> str:
        return self._output.read_text() if self._output.exists() else ""


def run_here(argv: list[str], output: Path, prepare: Callable[[], None] | None = None) -> None:
    """In a fork: become ``python -m src.run``."""
    os.setsid()
    file = os.open(output, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o644)
    for standard in (1, 2):
        os.dup2(file, standard)
    if prepare is not None:
        prepare()
    sys.argv = ["src.run", *argv]
    runpy.run_module("src.run", run_name="__main__", alter_sys=True)


def forked(results: Path, *arguments: str, prepare: Callable[[], None] | None = None) -> tuple[int, str]:
    """Run to its end: exit code and output."""
    process = Forked(results, *arguments, prepare=prepare)
    return process.wait(), process.output


def real(results: Path, *arguments: str, environment: dict[str, str] | None = None) -> subprocess.Popen[str]:
    """``python -m src.run``, from a shell's point of view, with more in its environment."""
    return subprocess.Popen(
        [sys.executable, "-m", "src.run", *arguments, f"results_dir={results}"],
        cwd=ROOT,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
        env={**os.environ, "COLUMNS": "200", **(environment or {})},
    )


def run_of(results: Path) -> Path:
    """The only run directory under ``results``."""
    (found,) = (results / "test" / "runs").glob("*/*/*/*/seed_*")
    return found


def manifest(results: Path) -> dict[str, Any]:
    content: dict[str, Any] = json.loads((run_of(results) / "manifest.json").read_text())
    return content


def weights(run: Path) -> dict[str, torch.Tensor]:
    content = read_archive(run / "policy.pt")
    return content["actor"] | {f"normalizer.{key}": torch.as_tensor(v) for key, v in content["normalizer"].items()}


def assert_same_end(results: Path, reference: Path) -> None:
    """Both are complete, with the same bytes of evaluations and the same bits of weights."""
    one, other = run_of(results), run_of(reference)
    assert manifest(results)["status"] == manifest(reference)["status"] == "complete"
    assert (one / "evaluations.csv").read_bytes() == (other / "evaluations.csv").read_bytes()
    a, b = weights(one), weights(other)
    assert a.keys() == b.keys()
    assert all(torch.equal(a[key], b[key]) for key in a), "the weights differ"
    left = {each.name for each in one.iterdir()}
    assert left <= {*FILES, "state"} - {"failure.txt"}, left
    assert not list((one / "state").glob(".checkpoint-*"))


def wait_for(condition: Callable[[], object], process: Any = None, seconds: float = 120, poll: float = 0.002) -> bool:
    """Poll until ``condition``; False where ``process`` has ended, or waits at its last gate, before that."""
    deadline = time.monotonic() + seconds
    while not condition():
        if process is not None and (not process.alive or process.at_gate()):
            return bool(condition())
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(poll)
    return True


def newest_checkpoint(results: Path) -> int:
    """Step of the newest checkpoint; -1 before the first."""
    names = (results / "test" / "runs").glob("*/*/*/*/seed_*/state/checkpoint-*.pt")
    return max((int(each.stem.removeprefix("checkpoint-")) for each in names), default=-1)


def limit_file_size(limit: int) -> None:
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))


def own_mounts() -> None:
    """Give this process a mount namespace of its own.

    Raises:
        OSError: not allowed here.
    """
    new_namespace, new_user = 0x00020000, 0x10000000
    libc = ctypes.CDLL(None, use_errno=True)
    if not hasattr(libc, "unshare"):
        raise OSError(0, "only Linux has mount namespaces")
    if libc.unshare(new_namespace | (0 if os.geteuid() == 0 else new_user)):
        raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))
    mount("--make-rprivate", "/")


def mount(*arguments: str) -> None:
    done = subprocess.run(["mount", *arguments], capture_output=True, text=True, check=False)
    if done.returncode:
        raise OSError(0, f"mount {' '.join(arguments)}: {done.stderr.strip()}")
