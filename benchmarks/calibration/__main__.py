"""How often the report's verdict rule is wrong, what it sees, and how often its intervals cover the truth.

    python -m benchmarks.calibration                       # tables on the screen, some minutes on one core
    python -m benchmarks.calibration --simulations 2000 --resamplings 100     # a look, half a minute
    python -m benchmarks.calibration --write               # and into docs/report.md and analysis/interval_coverage.yaml

Studies are simulated: five actors with the paper's five claims on four tasks. The same seed gives the same tables.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

from benchmarks.calibration import tables
from benchmarks.calibration.intervals import coverage
from benchmarks.calibration.laws import LAWS

ROOT = Path(__file__).resolve().parents[2]
REPORT = ROOT / "docs" / "report.md"
COVERAGE = ROOT / "analysis" / "interval_coverage.yaml"
BEGIN, END = "<!-- calibration: written by python -m benchmarks.calibration --write -->", "<!-- calibration ends -->"


def main(arguments: list[str] | None = None) -> None:
    """Simulate, print, and write where that is asked for."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.calibration",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--simulations", type=int, default=20_000, help="studies a row; default: %(default)s")
    parser.add_argument("--resamplings", type=int, default=1_000, help="studies a bootstrap; default: %(default)s")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--write", action="store_true", help="replace the tables in docs/report.md")
    options = parser.parse_args(arguments)
    if options.simulations < 1 or options.resamplings < 1:
        parser.error("--simulations and --resamplings are at least 1")
    started = time.perf_counter()
    parts = []
    for table in tables.verdict_tables(options.simulations, options.seed):
        parts.append(table)
        print(table, flush=True)
    covered = coverage(LAWS, options.simulations, options.resamplings, options.seed)
    parts.append(tables.coverage_table(covered, LAWS, options.simulations, options.resamplings))
    print(parts[-1], flush=True)
    print(f"{time.perf_counter() - started:.0f} s")
    if options.write:
        page = REPORT.read_text(encoding="utf-8")
        before, after = page.split(BEGIN)[0], page.split(END)[1]
        REPORT.write_text(f"{before}{BEGIN}\n{''.join(parts)}{END}{after}", encoding="utf-8")
        COVERAGE.write_text(tables.coverage_file(covered), encoding="utf-8")


if __name__ == "__main__":
    main()
