"""The report stage: figures and tables of a study as one self-contained HTML page and a Markdown twin."""

from __future__ import annotations

import base64
import json
import re
from pathlib import Path
from typing import Any

import jinja2

from analysis.data.errors import InputError
from analysis.data.writing import replaced_folder, write_text

SECTIONS = (
    ("figures", "Figures"),
    ("statistics", "Statistics"),
    ("health", "Spiking health and cost"),
    ("provenance", "Provenance"),
)
#: Figures are drawn at 200 pixels an inch; 0.65 shows 8-point type at the size of the page's small print.
CSS_SCALE = 0.65
MARKS = {"supported": "✓ supported", "contradicted": "✗ contradicted", "undecided": "? undecided"}


def render(folder: Path) -> Path:
    """Write ``results/<study>/report/index.html`` and ``report.md``; give the path of the page.

    Raises:
        InputError: the stages before this one have not run.
    """
    tables = _read(folder, "statistics", "tables.json")
    figures = _read(folder, "figures", "figures.json")
    about = _read(folder, "collected", "study.json")
    content = {
        "study": about["study"],
        "tables": {table["name"]: table for table in tables["tables"]},
        "figures": [_inlined(figure, folder / "figures") for figure in figures],
        "notes": tables["notes"],
        "overview": tables["overview"],
        "sections": SECTIONS,
        "marks": MARKS,
    }
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(Path(__file__).with_name("templates")),
        autoescape=jinja2.select_autoescape(["html"]),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters["markdown"] = escape_markdown
    environment.filters["anchor"] = lambda name: re.sub(r"[^A-Za-z0-9_-]", "-", name)
    with replaced_folder(folder / "report") as out:
        write_text(out / "index.html", environment.get_template("report.html").render(content))
        write_text(out / "report.md", environment.get_template("report.md").render(content))
    return folder / "report" / "index.html"


def escape_markdown(words: str) -> str:
    """Characters that Markdown, or the HTML inside it, would read as markup."""
    escaped = re.sub(r"([\\`*_{}\[\]|$])", r"\\\1", str(words).replace("\n", " "))
    return escaped.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")


def _inlined(figure: dict[str, Any], folder: Path) -> dict[str, Any]:
    """The figure with its PNG as a data URI and the width in CSS pixels at which it is drawn."""
    if not figure["drawn"]:
        return figure
    content = (folder / f"{figure['name']}.png").read_bytes()
    width = int.from_bytes(content[16:20], "big")  # of the IHDR chunk, which every PNG begins with
    return figure | {
        "uri": "data:image/png;base64," + base64.b64encode(content).decode("ascii"),
        "width": round(width * CSS_SCALE),
    }


def _read(folder: Path, stage: str, name: str) -> Any:
    try:
        return json.loads((folder / stage / name).read_bytes())
    except FileNotFoundError:
        command = {"collected": "collect"}.get(stage, stage)
        raise InputError(f"{folder / stage} is not there: run `python -m analysis {command} {folder}` first.") from None
