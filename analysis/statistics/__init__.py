"""The statistics stage: every table of the report, as CSV, LaTeX and display strings."""

from __future__ import annotations

from pathlib import Path

from analysis.claims import decide, overall
from analysis.claims_file import FILE, read_claims
from analysis.data.cells import cells_of
from analysis.data.study import Study
from analysis.data.writing import replaced_folder, write_json
from analysis.health import saturated
from analysis.overview import overview
from analysis.statistics import aggregates, cost, performance, provenance, verdicts
from analysis.statistics.notes import notes
from analysis.tables import Table


def build(study: Study, folder: Path, claims_path: Path = FILE) -> list[Table]:
    """Compute every table of a study and write ``results/<study>/statistics/``."""
    claims, cells = read_claims(claims_path), cells_of(study)
    rows, about = decide(study, cells, claims), overview(study)
    tables = [
        verdicts.overall_table(overall(rows, claims), rows, about["title"]),
        performance.main_table(cells, claims),
        verdicts.claims_table(rows, claims),
        performance.final_table(cells),
        performance.maxima_table(cells),
        aggregates.table(cells, claims),
        performance.published_table(cells),
        performance.seeds_table(cells),
        cost.energy_table(study),
        cost.health_table(study),
        cost.throughput_table(study),
        provenance.status_table(study),
        provenance.versions_table(study),
        provenance.cells_table(study),
    ]
    rule = verdicts.rule(rows, claims)
    told = [*study.warnings, *notes(study, cells, claims), *saturated(study)]
    with replaced_folder(folder / "statistics") as out:
        for table in tables:
            table.save(out)
        content = {"overview": {**about, "rule": rule}, "tables": [table.as_dict() for table in tables], "notes": told}
        write_json(out / "tables.json", content)
    return tables
