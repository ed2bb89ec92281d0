"""`make` picks a Python that can serve and never mixes two; CI tries what pyproject.toml promises.

If these fail, a user waits through a download of gigabytes to learn that the version was wrong.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import tomllib
from pathlib import Path

import pytest
import yaml

from tools import suitable

ROOT = Path(__file__).resolve().parents[1]

#: Stands for an interpreter: knows its version, makes environments of its kind, and writes down what it is asked to do.
FAKE = """#!/bin/sh
echo "{version} $*" >> "{log}"
case "$*" in
  "tools/suitable.py") [ {version} = 3.9 ] && {{ echo "3.9 can't serve" >&2; exit 1; }}; echo {version};;
  "-c import pip"*) echo {version};;
  "-m venv"*) rm -rf .venv; mkdir -p .venv/bin; cp "$0" .venv/bin/python;;
esac
"""


class Machine:
    """A folder with our Makefile, and interpreters on PATH."""

    def __init__(self, folder: Path) -> None:
        self.project, self.log, self._path = folder / "project", folder / "log", folder / "bin"
        self.project.mkdir()
        self._path.mkdir()
        for name in ("Makefile", "pyproject.toml", "constraints.txt"):
            shutil.copy(ROOT / name, self.project)

    def has(self, *versions: str) -> Machine:
        for version in versions:
            program = self._path / f"python{version}"
            program.write_text(FAKE.format(version=version, log=self.log))
            program.chmod(0o755)
        return self

    def make(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        """``make arguments``; what was done is the lines of :attr:`log`."""
        self.log.write_text("")
        for name in ("python", "python3"):  # those of this machine are not there
            (self._path / name).write_text("#!/bin/sh\nexit 1\n")
            (self._path / name).chmod(0o755)
        for version in ("3.11", "3.12", "3.13"):
            if not (program := self._path / f"python{version}").exists():
                program.write_text("#!/bin/sh\nexit 127\n")
                program.chmod(0o755)
        environment = {name: value for name, value in os.environ.items() if name not in ("PYTHON", "MAKEFLAGS")}
        environment["PATH"] = f"{self._path}{os.pathsep}{environment['PATH']}"
        return subprocess.run(
            ["make", *arguments], cwd=self.project, env=environment, capture_output=True, text=True, check=False
        )

    def did(self, what: str) -> list[str]:
        """The versions that were asked for something."""
        return [line.split()[0] for line in self.log.read_text().splitlines() if what in line]


@pytest.fixture
def machine(tmp_path: Path) -> Machine:
    return Machine(tmp_path)


def test_the_newest_that_can_serve_is_found(machine: Machine) -> None:
    done = machine.has("3.11", "3.12").make("setup")
    assert done.returncode == 0, done.stderr
    assert machine.did("-m venv") == ["3.12"] and set(machine.did("pip install")) == {"3.12"}


def test_the_second_time_nothing_is_done_whatever_else_was_installed_since(machine: Machine) -> None:
    machine.has("3.11").make("setup")
    done = machine.has("3.13").make("setup")
    assert done.returncode == 0, done.stderr
    assert machine.did("-m venv") == machine.did("pip install") == []


def test_another_version_is_built_anew_not_mixed(machine: Machine) -> None:
    machine.has("3.11", "3.13").make("setup", "PYTHON=python3.11")
    done = machine.make("setup", "PYTHON=python3.13")
    assert done.returncode == 0, done.stderr
    assert machine.did("-m venv --clear .venv") == ["3.13"] and set(machine.did("pip install")) == {"3.13"}
    machine.make("setup", "PYTHON=python3.13")
    assert machine.did("-m venv") == machine.did("pip install") == []


def test_an_environment_that_was_half_made_is_finished(machine: Machine) -> None:
    machine.has("3.12").make("setup")
    (machine.project / ".venv" / ".ready").unlink()
    machine.make("setup")
    assert machine.did("-m venv") == [] and machine.did("pip install")


@pytest.mark.parametrize("arguments", [("setup",), ("setup", "PYTHON=python3.9"), ("test", "PYTHON=nowhere")])
def test_a_python_that_can_not_serve_is_refused_before_anything_is_loaded(
    machine: Machine, arguments: tuple[str, ...]
) -> None:
    done = machine.has("3.9").make(*arguments)
    assert done.returncode == 2
    assert machine.did("-m venv") == machine.did("pip install") == []
    assert any(word in done.stderr for word in ("no Python 3.11, 3.12 or 3.13", "3.9 can't serve", "nowhere")), done


def test_why_an_interpreter_can_not_serve(monkeypatch: pytest.MonkeyPatch) -> None:
    assert suitable.why_not() is None
    for version in ((3, 10, 9), (3, 14, 0)):
        monkeypatch.setattr(suitable.sys, "version_info", version)
        assert "CPython 3.11, 3.12, 3.13" in str(suitable.why_not())
    monkeypatch.undo()
    monkeypatch.setitem(suitable.sys.modules, "ensurepip", None)
    assert "without ensurepip" in str(suitable.why_not())


def test_one_list_of_versions() -> None:
    """tools/suitable.py, pyproject.toml, the CI workflow and the README say the same."""
    names = [f"{major}.{minor}" for major, minor in suitable.VERSIONS]
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    major, minor = suitable.VERSIONS[-1]
    assert project["requires-python"] == f">={names[0]},<{major}.{minor + 1}"
    workflow = yaml.safe_load((ROOT / ".github" / "workflows" / "ci.yml").read_text())
    assert workflow["jobs"]["test"]["strategy"]["matrix"]["python"] == names
    assert f"Needs Python {names[0]}, {names[1]} or {names[2]}" in (ROOT / "README.md").read_text()


def test_every_workflow_runs_commands_that_exist() -> None:
    makefile = (ROOT / "Makefile").read_text()
    texts = [(ROOT / ".ci" / "run").read_text(), (ROOT / ".github" / "workflows" / "ci.yml").read_text()]
    for text in texts:
        targets = re.findall(r"\bmake ([a-z-]+)", text)
        assert targets == ["check", "test"] and all(f"\n{target}:" in makefile for target in targets)
