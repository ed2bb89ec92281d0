"""The report stage: figures and tables of a study as one self-contained HTML page and a Markdown twin."""

from __future__ import annotations

import base64
import hashlib
import json
import re
from pathlib import Path
from typing import Any
from urllib.parse import quote

import jinja2
from markupsafe import Markup, escape

from analysis.data.errors import InputError
from analysis.data.writing import replaced_folder, write_text
from analysis.policies import policies_section

SECTIONS = (
    ("figures", "Figures"),
    ("policies", "Policies"),
    ("statistics", "Statistics"),
    ("health", "Cost and spiking health"),
    ("provenance", "Provenance"),
)
TEMPLATES = Path(__file__).with_name("templates")
#: Figures are drawn at 200 pixels an inch; 0.6 shows 8-point type at the size of the page's small print.
CSS_SCALE = 0.6


def render(folder: Path) -> Path:
    """Write ``results/<study>/report/index.html`` and ``report.md``; give the path of the page.

    Raises:
        InputError: the stages before this one have not run.
    """
    tables = _read(folder, "statistics", "tables.json")
    figures = _read(folder, "figures", "figures.json")
    about = _read(folder, "collected", "study.json")
    policies = policies_section(folder)
    script = (TEMPLATES / "report.js").read_text(encoding="utf-8")
    content = {
        "study": about["study"],
        "tables": {table["name"]: _one_name(table) for table in tables["tables"]},
        "figures": [_inlined(figure, folder / "figures") for figure in figures],
        "notes": tables["notes"],
        "overview": tables["overview"],
        "policies": policies,
        "sections": [section for section in SECTIONS if section[0] != "policies" or policies],
        "marks": {verdict: style["mark"] for verdict, style in tables["overview"]["verdicts"].items()},
        "tones": {verdict: style["tone"] for verdict, style in tables["overview"]["verdicts"].items()},
        "style": Markup((TEMPLATES / "report.css").read_text(encoding="utf-8")),
        "script": Markup(script),
        "script_hash": Markup(script_hash(script)),
    }
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(TEMPLATES),
        autoescape=jinja2.select_autoescape(["html"]),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters["markdown"] = escape_markdown
    environment.filters["linked"] = linked
    environment.filters["anchor"] = lambda name: re.sub(r"[^A-Za-z0-9_-]", "-", name)
    with replaced_folder(folder / "report") as out:
        write_text(out / "index.html", environment.get_template("report.html").render(content))
        write_text(out / "report.md", environment.get_template("report.md").render(content))
    return folder / "report" / "index.html"


def script_hash(script: str) -> str:
    """The source expression by which the page's policy lets this one script run."""
    digest = hashlib.sha256(script.encode("utf-8")).digest()
    return f"sha256-{base64.b64encode(digest).decode('ascii')}"


def escape_markdown(words: str) -> str:
    """Characters that Markdown, or the HTML inside it, would read as markup."""
    escaped = re.sub(r"([\\`*_{}\[\]|$])", r"\\\1", str(words).replace("\n", " "))
    return escaped.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")


def linked(words: str) -> Markup:
    """Escaped text in which ``runs/<algo>/<env>/<label>/<encoder>/seed_<k>`` is a link to that folder."""
    parts = re.split(r"(runs/(?:[^/\s]+/){4}seed_\d+)", str(words))
    return Markup("").join(
        Markup('<a href="../{}/">{}</a>').format(quote(part), part) if index % 2 else escape(part)
        for index, part in enumerate(parts)
    )


def _one_name(table: dict[str, Any]) -> dict[str, Any]:
    """The table with the columns that name a row (algorithm, task, actor) set as one; what all rows share stands in
    the title, but for the last of these columns where a number follows it.
    """
    count = table["naming"]
    rows = table["rows"]
    if not count or not rows:
        return table
    last = count - 1 if table["numeric"][count] else count
    shared = [k for k in range(last) if len(rows) > 1 and len({row[k] for row in rows}) == 1]
    kept = [k for k in range(count) if k not in shared]
    title = ", ".join([table["title"], *(rows[0][k] for k in shared)])
    names = [", ".join(table["headers"][k] for k in kept)] if kept else []
    return table | {
        "title": title,
        "headers": [*names, *table["headers"][count:]],
        "numeric": [*[False for _ in names], *table["numeric"][count:]],
        "rows": [[*([", ".join(row[k] for k in kept)] if kept else []), *row[count:]] for row in rows],
    }


def _inlined(figure: dict[str, Any], folder: Path) -> dict[str, Any]:
    """The figure with its PNG as a data URI, its size in CSS pixels, and the data that the script draws."""
    if not figure["drawn"]:
        return figure
    content = (folder / f"{figure['name']}.png").read_bytes()
    width, height = (int.from_bytes(content[k : k + 4], "big") for k in (16, 20))  # of the IHDR chunk, always the first
    curves = ""
    if figure["curves"]:
        curves = Markup((folder / f"{figure['name']}.json").read_text(encoding="utf-8").replace("<", "\\u003c"))
    return figure | {
        "uri": "data:image/png;base64," + base64.b64encode(content).decode("ascii"),
        "width": round(width * CSS_SCALE),
        "height": round(height * CSS_SCALE),
        "curves": curves,
    }


def _read(folder: Path, stage: str, name: str) -> Any:
    try:
        return json.loads((folder / stage / name).read_bytes())
    except FileNotFoundError:
        command = {"collected": "collect"}.get(stage, stage)
        raise InputError(f"{folder / stage} is not there: run `python -m analysis {command} {folder}` first.") from None
