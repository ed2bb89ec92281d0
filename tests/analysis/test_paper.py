"""If these fail, what goes into an article has to be mended by hand, or is set in another size than it says."""

import re
import shutil
import subprocess

import pytest

from analysis.__main__ import main
from analysis.tables import CAPTION_WORDS, short_caption
from benchmarks.synthetic import write_grid, write_operations, write_run

PDFLATEX = shutil.which("pdflatex")


@pytest.fixture(scope="module")
def paper(tmp_path_factory):
    study = tmp_path_factory.mktemp("paper") / "s_1"
    actors = ("aan", "popsan", "bptsan_wo_li", "bptsan")
    write_grid(study, {"bptsan": 500.0}, envs=("hopper", "ant"), actors=actors, seeds=5)
    write_operations(write_run(study, actor="aan", seed=5), macs=40_000, acs=0)
    write_operations(write_run(study, actor="bptsan", seed=5), macs=1_000, acs=50_000, updates=2_000)
    write_run(study, label="mine_50%", manifest={"actor": "mine_50%"})
    assert main(["report", str(study), "--style", "paper", "--font", "serif"]) == 0
    return study / "paper"


def test_figures_are_one_or_two_columns_wide(paper):
    figures = sorted(paper.glob("*.pdf"))
    assert len(figures) >= 8
    for figure in figures:
        width = float(re.search(rb"/MediaBox \[ 0 0 ([0-9.]+)", figure.read_bytes()).group(1)) / 72
        assert width == pytest.approx(3.35, abs=0.01) or width == pytest.approx(7.0, abs=0.01), figure.name
    assert b"STIX" in (paper / "main-td3.pdf").read_bytes()


def test_tables_have_bold_best_values_and_no_rows_that_say_nothing(paper):
    main_ = (paper / "main.tex").read_text()
    assert all(rule in main_ for rule in (r"\toprule", r"\midrule", r"\bottomrule"))
    assert main_.count(r"\bfseries") == 2  # one a task
    assert "no run" not in main_ and r"mine\_50\%" in main_
    verdicts = (paper / "claims.tex").read_text()
    assert "beats itself without lateral interaction" in verdicts and "synergistic" not in verdicts
    operations = (paper / "operations.tex").read_text()
    assert "Ops / AAN" in operations and "Footprint" not in operations


def test_captions_are_short_whole_sentences(paper):
    captions = re.findall(r"\\caption\{(.*)\}", "".join(path.read_text() for path in paper.glob("*.tex")))
    assert len(captions) >= 12
    for caption in captions:
        assert len(caption.split()) < CAPTION_WORDS and caption.endswith(".")
    assert short_caption("One. Two three. Four five six.", 5) == "One. Two three."
    assert short_caption("A sentence that is too long alone.", 3) == "A sentence that is too long alone."


@pytest.mark.latex
@pytest.mark.skipif(PDFLATEX is None, reason="pdflatex is not installed (apt-get install texlive-latex-recommended)")
def test_the_article_compiles_and_nothing_sticks_out(paper, tmp_path):
    shutil.copytree(paper, tmp_path / "paper")
    command = [PDFLATEX, "-interaction=nonstopmode", "-halt-on-error", "article.tex"]
    result = subprocess.run(command, cwd=tmp_path / "paper", capture_output=True, text=True, timeout=120)
    assert result.returncode == 0, result.stdout[-2000:]
    assert "Overfull" not in result.stdout and "undefined" not in result.stdout
