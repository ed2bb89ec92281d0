"""If this fails, `dvc repro` in a fresh clone does not draw the figures again, or does more than it must."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import yaml

from benchmarks.synthetic import write_run

ROOT = Path(__file__).resolve().parents[2]


def run(*command, cwd):
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    environment = {**os.environ, "PATH": path, "DVC_NO_ANALYTICS": "1", "GIT_CONFIG_GLOBAL": os.devnull}
    result = subprocess.run(command, cwd=cwd, env=environment, capture_output=True, text=True, timeout=300)
    assert result.returncode == 0, result.stdout + result.stderr
    return result.stdout


def test_repro_in_a_fresh_clone_then_nothing_then_a_new_run(tmp_path):
    """One study with one run; no remote, no account, no network, no training."""
    origin, clone = tmp_path / "origin", tmp_path / "clone"
    ignore = shutil.ignore_patterns("__pycache__", "tmp", "cache")
    for name in ("analysis", ".dvc"):
        shutil.copytree(ROOT / name, origin / name, ignore=ignore)
    for name in (".dvcignore", ".gitignore"):
        shutil.copy(ROOT / name, origin / name)
    lines = [
        "  - studies: {s: {claims: results/s/claims.yaml}}" if line.startswith("  - studies:") else line
        for line in (ROOT / "dvc.yaml").read_text().splitlines()
    ]
    (origin / "dvc.yaml").write_text("\n".join(lines) + "\n")
    write_run(origin / "results/s", actor="aan")
    shutil.copy(ROOT / "analysis/claims.yaml", origin / "results/s/claims.yaml")
    run("git", "init", "-q", cwd=origin)
    run("git", "add", "-A", cwd=origin)
    run("git", "-c", "user.name=t", "-c", "user.email=t@example.org", "commit", "-qm", "a study", cwd=origin)
    run("git", "clone", "-q", str(origin), str(clone), cwd=tmp_path)

    first = run("dvc", "repro", cwd=clone)
    assert [f"Running stage '{stage}@s'" in first for stage in ("collect", "figures", "statistics", "report")] == [
        True
    ] * 4
    assert (clone / "results/s/report/index.html").is_file()
    assert "Running stage" not in run("dvc", "repro", cwd=clone)
    (clone / "results/s/runs/td3/hopper/aan/none/seed_0/state").mkdir()  # a checkpoint is no evidence
    (clone / "results/s/runs/td3/hopper/aan/none/seed_0/state/x.pt").write_text("x")
    assert "Running stage" not in run("dvc", "repro", cwd=clone)
    with (clone / "results/s/claims.yaml").open("a") as own:  # the study's own claims are no part of analysis/
        own.write("  - {name: mine, kind: difference, source: user, text: A claim of mine, better: x, worse: aan}\n")
    again = run("dvc", "repro", cwd=clone)
    assert "Running stage 'figures@s'" in again and "Running stage 'collect@s'" not in again
    assert "A claim of mine" in (clone / "results/s/statistics/claims.csv").read_text()
    write_run(clone / "results/s", actor="bptsan")
    assert "Running stage 'report@s'" in run("dvc", "repro", cwd=clone)
    assert "BPT-SAN" in (clone / "results/s/statistics/seeds.csv").read_text()


def test_collect_needs_nothing_of_the_analysis_that_dvc_does_not_watch():
    """Else a change there leaves ``collected/`` as it was, and the report shows what is no longer true."""
    loaded = "import sys, analysis.data.collected; print(*(m for m in sys.modules if m.startswith('analysis')))"
    modules = run(sys.executable, "-c", loaded, cwd=ROOT).split()
    assert {"analysis.data.errors", "analysis.data.schema"} < set(modules)
    assert all(name == "analysis" or name.startswith("analysis.data") for name in modules)
    stages = yaml.safe_load((ROOT / "dvc.yaml").read_text())["stages"]
    assert "analysis/data" in stages["collect"]["do"]["deps"]


def test_every_listed_study_depends_on_the_claims_that_hold_for_it():
    from analysis.claims_file import claims_path

    listed = yaml.safe_load((ROOT / "dvc.yaml").read_text())["vars"][0]["studies"]
    assert listed
    for name, study in listed.items():
        assert claims_path(ROOT / "results" / name).resolve() == (ROOT / study["claims"]).resolve()
