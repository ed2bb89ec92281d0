"""Everything that this repository claims about speed and memory, measured side by side on this machine.

    python -m benchmarks                          # all topics, under 15 minutes on 2 cores; writes benchmark.json
    python -m benchmarks --only update growth     # some of them
    python -m benchmarks --quick                  # a look whether it runs: its numbers say nothing

Every number is a ratio of two things measured in turns in one run; the machine should have nothing else to do.
"""

from __future__ import annotations

import argparse
import importlib
import json
import sys
import time
import traceback
from pathlib import Path
from typing import Any

from rich.console import Console

from benchmarks import machine
from benchmarks import topic as topics
from benchmarks.topic import Topic
from src.experiment import process
from src.experiment.files import replace_file

#: Each is a module with ``topic(quick)``.
TOPICS = ("update", "peers", "reference", "growth", "memory", "two_jobs", "gpu")


def main(arguments: list[str] | None = None) -> int:
    """Measure, print, write; 1 where a topic failed. A missed goal is red, not a failure."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", nargs="+", choices=TOPICS, default=list(TOPICS), metavar="TOPIC", help=str(TOPICS))
    parser.add_argument("--quick", action="store_true", help="seconds a topic, no meaning")
    parser.add_argument("--output", type=Path, default=Path("benchmark.json"), help="default: %(default)s")
    options = parser.parse_args(arguments)
    if not options.output.absolute().parent.is_dir():
        parser.error(f"--output: there is no folder {options.output.absolute().parent}")
    process.set_threads_before_torch(1)
    console = topics.console()
    described = machine.describe()
    content: dict[str, Any] = {"quick": options.quick, "machine": described, "seconds": 0, "topics": {}, "failed": {}}
    started = time.perf_counter()
    for line in machine.lines(described):
        console.print(line, highlight=False, markup=False)
    for name in [name for name in TOPICS if name in options.only]:
        try:
            topic = _measured(name, options.quick)
        except Exception as error:
            traceback.print_exc()
            content["failed"][name] = f"{type(error).__name__}: {error}"
        else:
            content["topics"][name] = topic.plain()
            _show(topic, console)
        content["seconds"] = round(time.perf_counter() - started)
        replace_file(options.output.absolute(), json.dumps(content, indent=1).encode())
    console.print(f"\n{content['seconds']} s, written: {options.output}", highlight=False, markup=False)
    for name, message in content["failed"].items():
        console.print(f"{name} failed: {message.splitlines()[0]}", highlight=False, markup=False)
    return 1 if content["failed"] else 0


def _measured(name: str, quick: bool) -> Topic:
    started = time.perf_counter()
    topic: Topic = importlib.import_module(f"benchmarks.{name}").topic(quick)  # torch loads here
    topic.seconds = time.perf_counter() - started
    return topic


def _show(topic: Topic, console: Console) -> None:
    console.print()
    if topic.rows:
        console.print(topic.table())
    for line in (topic.method, *topic.notes):
        console.print(line, highlight=False, markup=False)


if __name__ == "__main__":
    sys.exit(main())
