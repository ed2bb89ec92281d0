"""What Linux on x86 has and another machine may lack is taken away: a run must start there too."""

import os
import platform
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from src.experiment import machine
from src.experiment.process import PASSIVE_WAITING, thread_environment
from tests.experiment.runs import ROOT

ARM = "processor\t: 0\nBogoMIPS\t: 243.75\nCPU implementer\t: 0x41\nCPU architecture: 8\nCPU part\t: 0xd4f\n"


def without_proc(monkeypatch, content=None):
    read = Path.read_text

    def read_text(path, *arguments, **options):
        if path.is_relative_to("/proc"):
            if content is None:
                raise FileNotFoundError(path)
            return content
        return read(path, *arguments, **options)

    monkeypatch.setattr(Path, "read_text", read_text)


def test_cores_where_the_system_knows_no_affinity(monkeypatch):
    monkeypatch.delattr(os, "sched_getaffinity", raising=False)
    assert machine.usable_cores() == os.cpu_count()
    monkeypatch.setattr(os, "cpu_count", lambda: None)
    assert machine.usable_cores() == 1


@pytest.mark.skipif(not hasattr(os, "sched_getaffinity"), reason="no affinity here")
def test_cores_are_those_that_this_process_may_use(monkeypatch):
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {3, 5})
    assert machine.usable_cores() == 2


def test_a_processor_of_linux_on_arm_is_told_from_another(monkeypatch):
    without_proc(monkeypatch, ARM)
    monkeypatch.setattr(platform, "machine", lambda: "aarch64")
    assert machine.processor() == "aarch64 implementer 0x41 part 0xd4f"


def test_a_processor_without_proc(monkeypatch, tmp_path):
    without_proc(monkeypatch)
    monkeypatch.setenv("PATH", str(tmp_path))
    assert machine.processor() == (platform.processor() or platform.machine())
    sysctl = tmp_path / "sysctl"
    sysctl.write_text("#!/bin/sh\necho Apple M9\n")
    sysctl.chmod(0o755)
    assert machine.processor() == "Apple M9"


def test_the_token_of_a_boot_without_proc(monkeypatch):
    without_proc(monkeypatch)
    token = machine.boot_token()
    assert token == machine.boot_token() and len(token) == 16 and socket.gethostname() not in token
    monkeypatch.setattr(platform, "node", lambda: "another machine")
    assert machine.boot_token() != token


def test_two_threads_wait_passively(monkeypatch):
    """Spinning threads of a busy machine take the time of those that they wait for."""
    for name in PASSIVE_WAITING:
        monkeypatch.delenv(name, raising=False)
    assert PASSIVE_WAITING.items() <= thread_environment(2).items()
    assert set(thread_environment(1).values()) == {"1"}
    monkeypatch.setenv("OMP_WAIT_POLICY", "ACTIVE")
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "2")
    found = thread_environment(2).keys()
    assert not {"OMP_WAIT_POLICY", "OPENBLAS_NUM_THREADS"} & found, "the user has said otherwise"


SPINNING = """
from src.experiment.process import set_threads_before_torch
set_threads_before_torch(2)
import torch
"""


def test_openmp_sees_it():
    """What the library of PyTorch says that it does, where it is one that says so."""
    clean = {name: value for name, value in os.environ.items() if name not in PASSIVE_WAITING}
    done = subprocess.run(
        [sys.executable, "-c", SPINNING],
        cwd=ROOT,
        env=clean | {"OMP_DISPLAY_ENV": "VERBOSE"},
        capture_output=True,
        text=True,
        check=True,
    )
    if "GOMP_SPINCOUNT" not in done.stderr:
        pytest.skip("another OpenMP than GNU's")
    assert "OMP_WAIT_POLICY = 'PASSIVE'" in done.stderr and "GOMP_SPINCOUNT = '0'" in done.stderr


def test_the_file_itself_is_a_command():
    """Shell completion knows `python FILE.py` and no `python -m`."""
    command = [sys.executable, "src/run.py"]
    plan = subprocess.run([*command, "dry_run=true", "actor=aan"], cwd=ROOT, capture_output=True, text=True)
    assert plan.returncode == 0 and "1 run in" in plan.stdout, plan
    line = "python src/run.py actor="
    completing = {**os.environ, "COMP_LINE": line, "COMP_POINT": str(len(line))}
    words = subprocess.run([*command, "-sc", "query=bash"], cwd=ROOT, env=completing, capture_output=True, text=True)
    assert "actor=popsan" in words.stdout.split(), words
