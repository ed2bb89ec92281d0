"""The README's own actor trains, and the README's own names exist. If these fail, a newcomer's first hour is lost."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
README = (ROOT / "README.md").read_text()


def block(language: str) -> str:
    found = re.search(rf"```{language}\n(.*?)```", README, re.DOTALL)
    assert found is not None
    return found.group(1)


def test_the_readmes_actor_trains_and_its_seed_fixes_its_weights(tmp_path: Path) -> None:
    for folder in ("src", "conf", "sweeps"):
        shutil.copytree(ROOT / folder, tmp_path / folder, symlinks=True, ignore=shutil.ignore_patterns("__pycache__"))
    (tmp_path / "src" / "actors" / "my_actor.py").write_text(block("python"))
    (tmp_path / "conf" / "actor" / "my_actor.yaml").write_text(block("yaml"))
    tiny = "protocol=smoke protocol.total_steps=500 protocol.evaluation_interval=500 algo.critic_hidden_sizes=[32,32]"
    written = []
    for study in ("one", "two"):
        command = [sys.executable, "-m", "src.run", "actor=my_actor", "logger=none", f"study={study}", *tiny.split()]
        result = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
        assert result.returncode == 0, result.stdout + result.stderr
        (evaluations,) = (tmp_path / "results" / study).rglob("evaluations.csv")
        written.append(evaluations.read_bytes())
    assert written[0] == written[1]


def test_every_option_that_the_readme_names_exists() -> None:
    for group in ("actor", "algo", "env", "encoder", "protocol", "logger"):
        for option in (path.stem for path in (ROOT / "conf" / group).glob("*.yaml")):
            assert f"`{option}`" in README, f"{group}={option} is not in the README"
    for link in re.findall(r"\]\(([\w./-]+)\)", README):
        assert (ROOT / link).exists(), link
    for target in re.findall(r"make ([a-z-]+)", README):
        assert f"\n{target}:" in (ROOT / "Makefile").read_text()
