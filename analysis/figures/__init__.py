"""The figures stage. To add a figure: a file here with a function ``(view) -> list[Drawing]``, and a line below."""

from __future__ import annotations

from pathlib import Path

from matplotlib import pyplot as plt

from analysis.claims_file import claims_path, read_claims
from analysis.data.cells import cells_of
from analysis.data.names import ordered_algorithms
from analysis.data.study import Study
from analysis.data.writing import replaced_folder, write_json
from analysis.figures import (
    ablation_bars,
    curves_by,
    final_performance,
    forest,
    heat_map,
    intervals,
    learning_curves,
    probability_of_improvement,
    profiles,
    robustness,
    sample_efficiency,
    spiking_health,
    sweep_line,
)
from analysis.figures.drawing import Drawing
from analysis.figures.view import View
from analysis.style import SCREEN, Style
from analysis.verdicts import judge

#: In the order of the report.
FIGURES = (
    forest.draw,
    learning_curves.draw,
    curves_by.draw,
    heat_map.draw,
    ablation_bars.draw,
    final_performance.draw,
    intervals.draw,
    profiles.draw,
    sample_efficiency.draw,
    probability_of_improvement.draw,
    sweep_line.draw,
    robustness.draw,
    spiking_health.draw,
)


def build(
    study: Study, folder: Path, claims_file: Path | None = None, style: Style = SCREEN, by: tuple[str, ...] = ()
) -> list[Drawing]:
    """Draw everything for every algorithm of a study and write ``results/<study>/figures/``."""
    claims, cells = read_claims(claims_path(folder, claims_file)), cells_of(study)
    judgement = judge(study, cells, claims)
    drawings = []
    with plt.rc_context(style.rc), replaced_folder(folder / "figures") as out:
        for algo in ordered_algorithms(study.runs["algo"]):
            view = View(study, cells, claims, judgement, algo, style, by)
            for draw in FIGURES:
                for drawing in draw(view):
                    drawing.algo = algo
                    drawing.save(out)
                    drawings.append(drawing)
        write_json(out / "figures.json", [drawing.as_dict() for drawing in drawings])
    return drawings
