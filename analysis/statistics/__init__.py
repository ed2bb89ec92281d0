"""The statistics stage: every table of the report, as CSV, LaTeX and display strings."""

from __future__ import annotations

from pathlib import Path

from analysis.claims_file import Claims, claims_path, read_claims
from analysis.data.cells import Cell, cells_of
from analysis.data.study import Study
from analysis.data.writing import replaced_folder, write_json
from analysis.first_screen import first_screen
from analysis.health import saturated
from analysis.overview import overview
from analysis.statistics import aggregates, cost, failures, performance, provenance, published
from analysis.statistics import claims as claims_tables
from analysis.statistics.main_table import main_table
from analysis.statistics.notes import notes
from analysis.statistics.operations import operations_table
from analysis.tables import Table
from analysis.verdicts import Judgement, judge


def tables_of(study: Study, cells: list[Cell], claims: Claims, judgement: Judgement) -> list[Table]:
    """Every table, in the order of the report."""
    return [
        claims_tables.claims_table(judgement, overview(study)["title"]),
        main_table(cells, study.refused, claims),
        claims_tables.claims_by_task_table(judgement),
        performance.final_table(cells),
        performance.maxima_table(cells),
        aggregates.table(cells, claims),
        failures.rates_table(cells, claims),
        failures.comparisons_table(judgement),
        published.published_table(cells),
        performance.seeds_table(cells),
        operations_table(study),
        cost.health_table(study),
        cost.throughput_table(study),
        provenance.status_table(study),
        provenance.versions_table(study),
        provenance.cells_table(study),
    ]


def build(study: Study, folder: Path, claims_file: Path | None = None) -> list[Table]:
    """Compute every table of a study and write ``results/<study>/statistics/``."""
    claims, cells = read_claims(claims_path(folder, claims_file)), cells_of(study)
    judgement = judge(study, cells, claims)
    tables = tables_of(study, cells, claims, judgement)
    all_notes = [*study.warnings, *notes(study, cells, claims), *saturated(study)]
    with replaced_folder(folder / "statistics") as out:
        for table in tables:
            table.save(out)
        screen = first_screen(study, cells, judgement)
        write_json(
            out / "tables.json",
            {"overview": screen, "tables": [table.as_dict() for table in tables], "notes": all_notes},
        )
        write_json(out / "verdicts.json", claims_tables.plain(judgement))
    return tables
