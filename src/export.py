"""Carry a trained policy away: ``python -m src.export RUN --to onnx|nir`` writes one file that other tools read.

onnx: the whole policy, raw observations to actions. nir: the spiking network of PopSAN and of BPT-SAN without dendrites
and lateral terms, spikes to spikes. What can't be expressed is refused by name. Relative paths lie in the repository,
whatever the working directory. Needs `pip install '.[export]'`.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

from src.paths import repository_path, shown_path
from src.policies.command import parse, policy_parser, policy_path, run_command


def main(arguments: Sequence[str] | None = None) -> int:
    """Write the file and say what it takes and gives; returns the exit code."""
    parser = policy_parser("export", __doc__)
    parser.add_argument("--to", choices=("onnx", "nir"), required=True)
    parser.add_argument("--output", type=repository_path, help="the file (default: beside the policy file)")
    options = parse(parser, arguments)

    def work() -> None:
        path = policy_path(options.run, options.policy)
        output = options.output or path.with_suffix(f".{options.to}")
        print(f"wrote {shown_path(output)}: {export(path, options.to, output)}")

    return run_command(work)


def export(path: Path, to: str, output: Path) -> str:
    """Write the policy; returns what the file takes and gives."""
    from src.training.policy_file import load_policy

    trained = load_policy(path)
    if to == "onnx":
        from src.policies.export_onnx import export_onnx

        return f"{', '.join(export_onnx(trained, output))} -> action"
    from src.policies.export_nir import export_nir

    return export_nir(trained, output)


if __name__ == "__main__":
    sys.exit(main())
