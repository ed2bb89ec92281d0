"""``python -m analysis``: from run directories to figures, statistics and the report."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable
from pathlib import Path

from analysis.data.errors import InputError

EPILOG = """examples:
  python -m analysis report results/paper              everything; prints the path of the page
  python -m analysis report results/paper --by actor.lateral.radius
  python -m analysis report results/paper --style paper --font serif   for a two-column article
  python -m analysis compare bptsan popsan --study results/paper
  python -m analysis compare results/paper results/equal_rates --algo td3
  dvc repro                                            the same stages, for the studies that dvc.yaml lists

Claims are stated in analysis/claims.yaml, normalised scores in analysis/reference_scores.yaml; docs/report.md is the
how-to."""


def _collect(options: argparse.Namespace) -> None:
    from analysis.data.collected import collect
    from analysis.data.outcome import Outcome

    study = collect(options.study)
    counts = study.runs["counts_as"].value_counts()
    shown = ", ".join(f"{counts.get(kind, 0)} {kind}" for kind in Outcome)
    refused = f", {len(study.refused)} cell(s) refused" if study.refused else ""
    print(f"{options.study}/collected: {shown}{refused}; {len(study.warnings)} note(s)")
    for note in study.warnings[:10]:
        print(f"  {note}", file=sys.stderr)
    if len(study.warnings) > 10:
        print(f"  ... and {len(study.warnings) - 10} more, all of them in the report", file=sys.stderr)


def _figures(options: argparse.Namespace) -> None:
    from analysis.data.collected import load
    from analysis.figures import build
    from analysis.style import style_named

    style = style_named("screen", options.font)
    drawings = build(load(options.study), options.study, options.claims, style, _keys(options.by))
    print(f"{options.study}/figures: {sum(d.figure is not None for d in drawings)} drawn of {len(drawings)}")


def _statistics(options: argparse.Namespace) -> None:
    from analysis.data.collected import load
    from analysis.statistics import build

    tables = build(load(options.study), options.study, options.claims)
    print(f"{options.study}/statistics: {len(tables)} tables")


def _render(options: argparse.Namespace) -> None:
    from analysis.data.folders import check_study
    from analysis.render import render

    if not (options.study / "collected").is_dir():
        check_study(options.study)
    print(render(options.study))


def _report(options: argparse.Namespace) -> None:
    from analysis.claims_file import claims_path, read_claims

    read_claims(claims_path(options.study, options.claims))  # a mistake there is an error before the minutes of drawing
    _keys(options.by)
    stages = (_collect, _paper) if options.style == "paper" else (_collect, _figures, _statistics, _render)
    for stage in stages:
        stage(options)


def _paper(options: argparse.Namespace) -> None:
    from analysis.data.collected import load
    from analysis.paper import build_paper
    from analysis.style import style_named

    style = style_named("paper", options.font)
    print(build_paper(load(options.study), options.study, style, options.claims, _keys(options.by)))


def _keys(given: str | None) -> tuple[str, ...]:
    """The keys of ``--by``, at most two."""
    keys = tuple(key.strip() for key in given.split(",")) if given else ()
    if len(keys) > 2 or not all(keys) or len(set(keys)) < len(keys):
        raise InputError(f"--by takes one key or two different ones with a comma between them, found {given!r}.")
    return keys


def _compare(options: argparse.Namespace) -> None:
    from analysis.compare import compare, side

    a, b = side(options.a, options.study), side(options.b, options.study)
    table, notes = compare(a, b, options.algo)
    if options.format == "csv":
        print(table.frame.to_csv(index=False, lineterminator="\n"), end="")
    elif options.format == "latex":
        print(table.latex(), end="")
    else:
        _print_table(table.headers(), table.rows())
        print(table.caption)
    for note in notes:
        print(f"note: {note}", file=sys.stderr)


def _print_table(headers: list[str], rows: list[list[str]]) -> None:
    widths = [max(map(len, column)) for column in zip(headers, *rows)]
    for line in (headers, ["-" * width for width in widths], *rows):
        print("  ".join(value.ljust(width) for value, width in zip(line, widths)).rstrip())


def _path(given: str) -> Path:
    """``~`` is the home folder also where the shell leaves it alone; else paths start where the command is typed."""
    return Path(given).expanduser()


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m analysis",
        description=__doc__,
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")

    def add(name: str, what: str, function: Callable[[argparse.Namespace], None]) -> argparse.ArgumentParser:
        command = commands.add_parser(name, help=what, description=what)
        command.set_defaults(function=function)
        return command

    study = {"type": _path, "metavar": "results/STUDY", "help": "the study's folder; its run directories lie in runs/"}
    stages: tuple[tuple[str, str, Callable[[argparse.Namespace], None]], ...] = (
        ("report", "all four stages: collect, figures, statistics, render", _report),
        ("collect", "read and check the run directories; write collected/", _collect),
        ("figures", "draw the figures from collected/; write figures/", _figures),
        ("statistics", "compute tables and verdicts from collected/; write statistics/", _statistics),
        ("render", "write report/index.html and report/report.md from the other stages' files", _render),
    )
    for name, what, function in stages:
        command = add(name, what, function)
        command.add_argument("study", **study)  # type: ignore[arg-type]
        if name in ("report", "figures", "statistics"):
            command.add_argument(
                "--claims", type=_path, help="another claims file than the study's own or analysis/claims.yaml"
            )
        if name in ("report", "figures"):
            by = "facet and colour by a configuration key (protocol.total_steps); a heat map by two: KEY,KEY"
            command.add_argument("--by", metavar="KEY", help=by)
            command.add_argument("--font", choices=("sans", "serif"), default="sans", help="the letters of figures")
        if name == "report":
            where = "paper: instead of the page, figures and tables for a two-column article, in results/STUDY/paper"
            command.add_argument("--style", choices=("screen", "paper"), default="screen", help=where)
    command = add("compare", "set two labels, algorithms or studies side by side", _compare)
    command.add_argument(
        "a",
        type=os.path.expanduser,
        metavar="A",
        help="a study (results/paper), a label or an algorithm of one (results/paper:bptsan, results/paper:td3, "
        "results/paper:td3/bptsan), or the same of --study (bptsan, td3, td3/bptsan)",
    )
    command.add_argument("b", type=os.path.expanduser, metavar="B", help="the same")
    command.add_argument("--study", type=_path, help="the study that bare labels belong to")
    command.add_argument("--algo", help="only this algorithm, such as td3")
    command.add_argument("--format", choices=("text", "csv", "latex"), default="text")
    return parser


def main(arguments: list[str] | None = None) -> int:
    """Run one command; 0, or 2 with a sentence where the input is wrong."""
    options = _parser().parse_args(arguments)
    try:
        options.function(options)
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    except OSError as error:
        if error.filename is None:
            raise
        print(f"error: {error.filename}: {error.strerror}.", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
