"""How long a report of 400 runs x 100 evaluations takes on one core: the budget is a minute.

    python benchmarks/analysis_report.py          # builds a synthetic study in a temporary folder, prints seconds
    per stage

Two algorithms x four tasks x five actors x ten seeds, written by the tests' generator. The report runs in one
process whose
libraries are held to one thread; processor seconds are printed beside wall seconds, so that a busy machine doesn't
deceive.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
STAGES = ("collect", "figures", "statistics", "render")


def _timed(arguments: list[str]) -> tuple[float, float]:
    """Wall and processor seconds of ``python -m analysis ...`` on one thread."""
    threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    subprocess.run(
        [sys.executable, "-m", "analysis", *arguments],
        check=True,
        cwd=ROOT,
        env={**os.environ, **threads},
        stdout=subprocess.DEVNULL,
    )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.perf_counter() - start, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main() -> int:
    """Write the study, time the whole report and (with ``--stages``) each stage; exit 1 past the budget."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seeds", type=int, default=10, help="seeds per cell; there are 40 cells")
    parser.add_argument("--budget", type=float, default=60.0, help="processor seconds")
    parser.add_argument("--stages", action="store_true", help="time the stages one by one as well")
    options = parser.parse_args()
    sys.path.insert(0, str(ROOT))
    from benchmarks.synthetic import SIZES, write_grid

    with tempfile.TemporaryDirectory() as folder:
        study = Path(folder) / "synthetic"
        write_grid(
            study,
            {"bptsan": 300.0},
            algos=("td3", "sac"),
            envs=tuple(SIZES),
            seeds=options.seeds,
            noise=300,
            total_steps=1_000_000,
        )
        runs = sum(1 for _ in study.rglob("manifest.json"))
        wall, processor = _timed(["report", str(study)])
        result = {
            "runs": runs,
            "evaluations": 101,
            "report": {"wall_seconds": round(wall, 1), "processor_seconds": round(processor, 1)},
        }
        if options.stages:
            for stage in STAGES:
                seconds = _timed([stage, str(study)])
                result[stage] = {"wall_seconds": round(seconds[0], 1), "processor_seconds": round(seconds[1], 1)}
    print(json.dumps(result, indent=1))
    return 0 if processor < options.budget else 1


if __name__ == "__main__":
    raise SystemExit(main())
