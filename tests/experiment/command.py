"""Run the real commands in processes of their own, with the pretending trainer of ``stub/sitecustomize.py``."""

import json
import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
STUB = Path(__file__).parent / "stub"


def environment(**plan):
    return {**os.environ, "PYTHONPATH": f"{STUB}{os.pathsep}{ROOT}", "STUB": json.dumps(plan), "COLUMNS": "200"}


def start(results, *arguments, module="src.run", cwd=ROOT, **plan):
    command = [sys.executable, "-m", module, *arguments]
    if module == "src.run":
        command += [f"results_dir={results}"]
    return subprocess.Popen(
        command,
        cwd=cwd,
        env=environment(**plan),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def said(process, text):
    """Whether a running command has printed ``text`` (which is then no longer in what it prints to its end)."""
    found = process.stdout.readline()
    while found and text not in found:
        found = process.stdout.readline()
    return bool(found)


class Done:
    def __init__(self, process, timeout=300):
        try:
            self.out, self.err = process.communicate(timeout=timeout)
        finally:
            process.kill()
        self.code = process.returncode

    def __repr__(self):
        return f"exit {self.code}\n--- out\n{self.out}\n--- err\n{self.err}"


def run(results, *arguments, **plan):
    return Done(start(results, *arguments, **plan))


def run_path(results, seed=0, study="smoke", algo="td3", env="hopper", label="bptsan", encoder="poisson"):
    return Path(results) / study / "runs" / algo / env / label / encoder / f"seed_{seed}"


def manifest(results, seed=0, **where):
    return json.loads((run_path(results, seed, **where) / "manifest.json").read_text())


def calls(results, seed=0, **where):
    return (run_path(results, seed, **where) / "state" / "calls").read_text().splitlines()
