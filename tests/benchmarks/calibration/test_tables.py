"""If these fail, the calibration in the documents is not what its command gives."""

import re
from pathlib import Path

import yaml

from analysis import coverage
from benchmarks.calibration import __main__ as command
from benchmarks.calibration import studies
from benchmarks.calibration.laws import LAWS
from benchmarks.calibration.studies import rates


def test_the_same_seed_gives_the_same_rates_and_another_does_not():
    scenario = studies.no_effect(LAWS[0], 5)
    first = rates("x", scenario, 300, 0)
    assert first == rates("x", scenario, 300, 0) != rates("x", scenario, 300, 1)
    assert 0 < first["answers"] < 0.1


def test_chunks_change_no_weight(monkeypatch):
    monkeypatch.setattr(studies, "CHUNK", 100)
    ones = rates("x", lambda generator, size: {"all": studies.np.ones(size)}, 250, 0)
    assert abs(ones["all"] - 1) < 1e-12


def test_write_replaces_the_tables_and_the_file_that_captions_quote(tmp_path, monkeypatch, capsys):
    page, numbers = tmp_path / "report.md", tmp_path / "coverage.yaml"
    page.write_text(f"before\n{command.BEGIN}\nstale\n{command.END}\nafter\n")
    monkeypatch.setattr(command, "REPORT", page)
    monkeypatch.setattr(command, "COVERAGE", numbers)
    command.main(["--simulations", "20", "--resamplings", "2", "--write"])
    text = page.read_text()
    assert text.startswith("before\n") and text.endswith("after\n") and "stale" not in text
    assert "All actors equal" in text and "All actors equal" in capsys.readouterr().out
    found = yaml.safe_load(numbers.read_text())
    assert set(found) == set(coverage.intervals())
    assert all(0 <= low <= high <= 100 for by_n in found.values() for low, high in by_n.values())


def test_the_documents_hold_tables_within_their_level():
    """Wrong answers in at most 0.05 of the null studies, plus Monte Carlo error."""
    page = (Path(command.ROOT) / "docs/report.md").read_text()
    tables = page.split(command.BEGIN)[1].split(command.END)[0]
    null = tables.split("All actors equal")[1].split("**A true difference")[0]
    lines = [line for line in null.splitlines() if re.match(r"\| (normal|log|bimodal)", line)]
    rows = [re.split(r"\s*\|\s*", line)[1:-1] for line in lines]
    assert len(rows) == len(LAWS)
    for row in rows:
        assert max(map(float, row[1:7])) <= 0.053  # answers at 5, 6, 10, every task, looks, two algorithms
