"""The statistics stage: every table of the report, as CSV, LaTeX and display strings."""

from __future__ import annotations

from pathlib import Path

from analysis.claims_file import claims_path, read_claims
from analysis.data.cells import cells_of
from analysis.data.study import Study
from analysis.data.writing import replaced_folder, write_json
from analysis.health import saturated
from analysis.overview import overview
from analysis.statistics import aggregates, cost, performance, provenance, verdicts
from analysis.statistics.notes import notes
from analysis.tables import Table
from analysis.verdicts import judge
from analysis.verdicts.wording import rule_words


def build(study: Study, folder: Path, claims_file: Path | None = None) -> list[Table]:
    """Compute every table of a study and write ``results/<study>/statistics/``."""
    claims, cells = read_claims(claims_path(folder, claims_file)), cells_of(study)
    judgement, about = judge(study, cells, claims), overview(study)
    tables = [
        verdicts.claims_table(judgement, about["title"]),
        performance.main_table(cells, claims),
        verdicts.tasks_table(judgement),
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
    rule = rule_words(judgement)
    told = [*study.warnings, *notes(study, cells, claims), *saturated(study)]
    with replaced_folder(folder / "statistics") as out:
        for table in tables:
            table.save(out)
        content = {"overview": {**about, "rule": rule}, "tables": [table.as_dict() for table in tables], "notes": told}
        write_json(out / "tables.json", content)
        write_json(out / "verdicts.json", verdicts.plain(judgement))
    return tables
