"""The figures stage. To add a figure: a file here with a function
``(study, cells, algo, claims) -> list[Drawing]``, and a line below.
"""

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
    final_performance,
    intervals,
    learning_curves,
    probability_of_improvement,
    profiles,
    sample_efficiency,
    spiking_health,
    sweep_line,
)
from analysis.figures.drawing import Drawing
from analysis.style import RC

#: In the order of the report.
FIGURES = (
    learning_curves.draw,
    ablation_bars.draw,
    final_performance.draw,
    intervals.draw,
    profiles.draw,
    sample_efficiency.draw,
    probability_of_improvement.draw,
    sweep_line.draw,
    spiking_health.draw,
)


def build(study: Study, folder: Path, claims_file: Path | None = None) -> list[Drawing]:
    """Draw everything for every algorithm of a study and write ``results/<study>/figures/``."""
    claims, cells, drawings = read_claims(claims_path(folder, claims_file)), cells_of(study), []
    with plt.rc_context(RC), replaced_folder(folder / "figures") as out:
        for algo in ordered_algorithms(study.runs["algo"]):
            for draw in FIGURES:
                for drawing in draw(study, cells, algo, claims):
                    drawing.save(out)
                    drawings.append(drawing)
        write_json(out / "figures.json", [drawing.as_dict() for drawing in drawings])
    return drawings
