"""Carry a trained policy away: ``python -m src.export RUN --to onnx|nir`` writes one file that other tools read.

onnx: the whole policy, raw observations to actions. nir: the spiking network of PopSAN and of BPT-SAN without dendrites
and lateral terms, spikes to spikes. What can't be expressed is refused by name. Relative paths lie in the repository,
whatever the working directory. Needs `pip install '.[export]'`.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from src.config.schema import ConfigurationError
from src.experiment import process
from src.paths import repository_path, shown_path
from src.policies.find import BEST, FINAL, policy_path

FORMATS = ("onnx", "nir")


def parse(arguments: Sequence[str] | None = None) -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(
        prog="python -m src.export", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("run", type=repository_path, help="a run directory, or a policy file")
    parser.add_argument("--to", choices=FORMATS, required=True)
    parser.add_argument("--policy", choices=(FINAL, BEST), default=FINAL, help="of a run directory (default: final)")
    parser.add_argument("--output", type=repository_path, help="the file (default: beside the policy file)")
    return parser.parse_args(arguments)


def main(arguments: Sequence[str] | None = None) -> int:
    """Write the file and say what it takes and gives; returns the exit code."""
    options = parse(arguments)
    try:
        path = policy_path(options.run, options.policy)
        output = options.output or path.with_suffix(f".{options.to}")
        print(f"wrote {shown_path(output)}: {export(path, options.to, output)}")
    except (ConfigurationError, RuntimeError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    return 0


def export(path: Path, to: str, output: Path) -> str:
    """Write the policy; returns what the file takes and gives."""
    process.set_threads_before_torch(1)
    from src.policies.load import load_policy

    trained = load_policy(path)
    if to == "onnx":
        from src.policies.export_onnx import export_onnx

        return f"{', '.join(export_onnx(trained, output))} -> action"
    from src.policies.export_nir import export_nir

    return export_nir(trained, output)


if __name__ == "__main__":
    sys.exit(main())
