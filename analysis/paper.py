"""``--style paper``: figures and tables that go into a two-column article as they are.

Figures are PDFs of exactly one column (3.35 in) or two (7.0 in), all type 8 points once placed at their own size;
tables are booktabs with bold best values and captions under 60 words. ``article.tex`` includes them all and compiles.
"""

from __future__ import annotations

from pathlib import Path

from matplotlib import pyplot as plt

from analysis.claims_file import claims_path, read_claims
from analysis.data.cells import cells_of
from analysis.data.names import ordered_algorithms
from analysis.data.study import Study
from analysis.data.writing import replaced_folder, write_text
from analysis.figures import FIGURES
from analysis.figures.drawing import Drawing
from analysis.figures.view import View
from analysis.statistics import tables_of
from analysis.style import Style
from analysis.tables import escape_latex, short_caption
from analysis.verdicts import judge

#: The tables of an article; the others are for those who attack it, and stand in ``statistics/``.
TABLES = ("main", "claims", "aggregates", "max_average_return", "operations")
_PREAMBLE = r"""\documentclass[10pt,twocolumn]{article}
\usepackage[letterpaper,textwidth=7in,textheight=9in,columnsep=0.3in]{geometry}
\usepackage[T1]{fontenc}
\usepackage[utf8]{inputenc}
\usepackage{booktabs,graphicx}
"""


def build_paper(
    study: Study, folder: Path, style: Style, claims_file: Path | None = None, by: tuple[str, ...] = ()
) -> Path:
    """Write ``results/<study>/paper/``; give the path of ``article.tex``."""
    claims, cells = read_claims(claims_path(folder, claims_file)), cells_of(study)
    judgement = judge(study, cells, claims)
    tables = {table.name: table for table in tables_of(study, cells, claims, judgement)}
    blocks: list[str] = []
    with plt.rc_context(style.rc), replaced_folder(folder / "paper") as out:
        for algo in ordered_algorithms(study.runs["algo"]):
            view = View(study, cells, claims, judgement, algo, style, by)
            for draw in FIGURES:
                for drawing in draw(view):
                    if drawing.figure is not None:
                        width = float(drawing.figure.get_figwidth())
                        drawing.save(out, alone=True)
                        blocks.append(_figure(drawing, width > style.narrow + 0.01))
        for name in TABLES:
            if name in tables and tables[name].rows():
                write_text(out / f"{name}.tex", tables[name].latex(brief=True))
                blocks.append(f"\\input{{{name}.tex}}")
        write_text(out / "article.tex", _article(study.name, blocks, style))
    return folder / "paper" / "article.tex"


def _figure(drawing: Drawing, wide: bool) -> str:
    kind = "figure*" if wide else "figure"
    caption = escape_latex(short_caption(f"{drawing.title}. {drawing.caption}"))
    return "\n".join(
        (
            f"\\begin{{{kind}}}",
            "\\centering",
            f"\\includegraphics{{{{{drawing.name}}}.pdf}}",
            f"\\caption{{{caption}}}",
            f"\\label{{fig:{drawing.name}}}",
            f"\\end{{{kind}}}",
        )
    )


def _article(study: str, blocks: list[str], style: Style) -> str:
    fonts = "\\usepackage{mathptmx}\n" if "STIX" in str(style.rc["font.family"]) else ""
    body = "\n\n".join(
        [*blocks[:1], *(f"\\clearpage\n{block}" if k % 12 == 0 else block for k, block in enumerate(blocks[1:], 1))]
    )
    title = f"\\title{{Study {escape_latex(study)}}}\n\\date{{}}\n"
    words = "Figures and tables of this study, each to be included as it is."
    return f"{_PREAMBLE}{fonts}{title}\\begin{{document}}\n\\maketitle\n{words}\n\n{body}\n\\end{{document}}\n"
