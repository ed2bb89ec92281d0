"""If these fail, the report of a study is not what its logs say, or not the same twice."""

import base64
import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from urllib.parse import unquote

import pandas as pd
import pytest

from analysis import metrics
from analysis.__main__ import main
from analysis.compare import compare, side
from analysis.data.study import read_study
from benchmarks.synthetic import write_grid, write_run

ROOT = Path(__file__).resolve().parents[2]


def files(study):
    outputs = [
        path for path in sorted(study.rglob("*")) if path.is_file() and "runs" not in path.relative_to(study).parts
    ]
    return {str(path.relative_to(study)): path.read_bytes() for path in outputs}


def page(study):
    return (study / "report" / "index.html").read_text(encoding="utf-8")


def tables_of(study):
    return json.loads((study / "statistics/tables.json").read_text())


def test_same_logs_same_bytes_whatever_the_order_of_folders(mixed_report, tmp_path):
    """Built again in a process with another hash seed, from folders created in the opposite order."""
    again = tmp_path / "mixed"
    for source in sorted(mixed_report.joinpath("runs").rglob("*"), reverse=True):
        target = again / source.relative_to(mixed_report)
        if source.is_dir():
            target.mkdir(parents=True, exist_ok=True)
        else:
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(source, target)
    command = """
import os, sys
real = os.scandir
class Backwards:
    def __init__(self, path="."):
        with real(path) as entries:
            self.entries = sorted(entries, key=lambda entry: entry.name, reverse=True)
    __iter__ = lambda self: iter(self.entries)
    __enter__ = lambda self: self
    __exit__ = lambda self, *_: None
listed = os.listdir
os.scandir, os.listdir = Backwards, lambda path=".": sorted(listed(path), reverse=True)
import pathlib
names = [path.name for path in pathlib.Path(sys.argv[1], "runs/td3/hopper").rglob("*") if path.name.startswith("seed_")]
assert names.index("seed_1") < names.index("seed_0"), "the order of folders is not the opposite one"
from analysis.__main__ import main
sys.exit(main(["report", sys.argv[1]]))
"""
    subprocess.run(
        [sys.executable, "-c", command, str(again)], check=True, cwd=ROOT, env={**os.environ, "PYTHONHASHSEED": "7"}
    )
    first, second = files(mixed_report), files(again)
    assert first.keys() == second.keys() and len(first) > 40
    assert [name for name in first if first[name] != second[name]] == []


def test_stages_one_by_one_give_what_report_gives(mixed_report, tmp_path):
    study = shutil.copytree(
        mixed_report, tmp_path / "mixed", ignore=shutil.ignore_patterns("collected", "figures", "statistics", "report")
    )
    for stage in ("collect", "figures", "statistics", "render"):
        assert main([stage, str(study)]) == 0
    first, second = files(mixed_report), files(study)
    assert first.keys() == second.keys()
    assert [name for name in first if first[name] != second[name]] == []


def test_what_all_rows_share_stands_in_the_title_of_a_table_and_rows_in_one_order(mixed_report):
    html = page(mixed_report)
    assert "The claims at 100,000 steps, TD3 (" in html and 'data-title="Every claim on every task, TD3"' in html
    rows = {}
    for name in ("table-spiking_health", "table-cells", "table-runs"):
        table = html[html.index(f'id="{name}"') :]
        rows[name] = [
            words
            for words in re.findall(r'<th scope="row">([^<]*)</th>', table[: table.index("</table>")])
            if "radius" not in words
        ]
    first = ["Hopper-v4, AAN", "Hopper-v4, Regular SAN (PopSAN)", "Hopper-v4, BPT-SAN w/o NDT"]
    assert rows["table-cells"][:3] == rows["table-runs"][:3] == first
    assert list(dict.fromkeys(rows["table-spiking_health"]))[:2] == first[1:]


def test_it_begins_with_verdicts_then_the_table_and_names_what_is_missing(mixed_report):
    html = page(mixed_report)
    first = html.index('class="answer"')
    headings = [
        html.index(f"<h2>{words}</h2>")
        for words in ("The claims at 100,000 steps", "Final performance, TD3", "Figures")
    ]
    later = [
        html.index(f"<h2>{words}</h2>") for words in ("Statistics", "Cost and spiking health", "Provenance", "Notes")
    ]
    assert [first, *headings, *later] == sorted([first, *headings, *later])
    assert "Too few seeds to judge: no claim has more than 3 finished seeds" in html
    assert "my notes: its path is not" in html and "diverged runs: BPT-SAN 1" in html
    runs = pd.read_csv(mixed_report / "statistics/runs.csv").set_index(["env", "arm"])
    assert str(runs.loc[("ant", "popsan"), "missing"]) in ("2, 3", "2–3")
    assert "running, 50,000 of 100,000" in runs.loc[("hopper", "bptsan"), "unfinished"]


def test_no_request_can_leave_the_page_and_only_its_own_script_runs(mixed_report):
    html = page(mixed_report)
    assert not re.search(r"""src=["'](?!data:)""", html) and not re.search(r"""href=["'](?!data:|#|\.\./)""", html)
    assert "@import" not in html and "url(" not in html and not re.search(r"<[a-z][^>]*\son\w+=", html)
    policy = re.search(r'Content-Security-Policy" content="([^"]*)"', html).group(1)
    assert "default-src 'none'" in policy and "unsafe-eval" not in policy
    (script,) = re.findall(r"<script>(.*?)</script>", html, flags=re.S)
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    assert f"script-src 'sha256-{digest}'" in policy
    for kind in re.findall(r"<script([^>]*)>", html):
        assert kind == "" or 'type="application/json"' in kind


def test_every_link_leads_to_a_file_or_a_place_of_the_page(mixed_report):
    html = page(mixed_report)
    links = set(re.findall(r'href="([^"]+)"', html)) - {"data:,"}
    assert len(links) > 40
    for link in links:
        if link.startswith("#"):
            assert f'id="{link[1:]}"' in html, link
        else:
            assert (mixed_report / "report" / unquote(link)).exists(), link


def test_pictures_are_described_by_what_they_show(mixed_report):
    descriptions = re.findall(r'<img[^>]* alt="([^"]*)"', page(mixed_report))
    assert len(descriptions) >= 9 and all(re.search(r"\d", words) and len(words) > 40 for words in descriptions)
    assert any("BPT-SAN" in words and "Hopper-v4" in words for words in descriptions)


def test_the_bootstraps_caveat_is_said_once(mixed_report):
    assert page(mixed_report).count("With few seeds bootstrap intervals are too narrow") == 1


def test_the_csv_beside_a_figure_is_what_it_draws(mixed_report):
    drawn = pd.read_csv(mixed_report / "figures/main-td3.csv")
    study = read_study(mixed_report)
    mine = study.evaluations[(study.evaluations["arm"] == "aan") & (study.evaluations["env"] == "hopper")]
    _, returns, _ = metrics.seed_matrix(mine)
    found = drawn[(drawn["arm"] == "aan") & (drawn["env"] == "hopper")]
    assert found["mean"].to_numpy() == pytest.approx(returns.mean(axis=0))
    assert found["half_std"].to_numpy() == pytest.approx(returns.std(axis=0, ddof=1) / 2)
    assert found["mean_smoothed"].to_numpy() == pytest.approx(metrics.smooth(returns.mean(axis=0), 3))
    bars = pd.read_csv(mixed_report / "figures/ablation-td3.csv").set_index(["env", "arm"])
    assert (bars["mean_of_max"] >= bars["max_of_mean"]).all()
    assert bars.loc[("hopper", "bptsan"), "n"] == 3  # the running fourth seed has no part


def test_swept_key_gets_a_line_with_the_unchanged_actor_on_it(mixed_report):
    sweep = pd.read_csv(mixed_report / "figures/sweep-td3-actor.lateral.radius.csv")
    assert sweep["value"].tolist() == [1, 2, 4] and sweep["n"].tolist() == [3, 3, 3]


def test_every_figure_has_pdf_png_and_csv(mixed_report):
    figures = json.loads((mixed_report / "figures/figures.json").read_text())
    assert {f["name"] for f in figures} >= {
        "main-td3",
        "ablation-td3",
        "final-td3",
        "profile-td3",
        "efficiency-td3",
        "improvement-td3",
        "health-td3-ant",
    }
    for figure in figures:
        for kind in ("pdf", "png", "csv"):
            assert (mixed_report / "figures" / f"{figure['name']}.{kind}").stat().st_size > 100
        assert figure["caption"]


def test_latex_is_booktabs_and_escaped(mixed_report):
    latex = (mixed_report / "statistics/main.tex").read_text()
    assert all(rule in latex for rule in (r"\toprule", r"\midrule", r"\bottomrule", r"$\pm$"))
    assert r"max\_of\_mean" in (mixed_report / "statistics/max_average_return.tex").read_text()


def test_names_from_files_are_escaped(tmp_path):
    evil = "<img src=x onerror=alert(1)>&|$x$_{b}"
    for seed in range(3):
        write_run(
            tmp_path / "s",
            seed=seed,
            label=evil,
            changes={"actor.lateral.radius": 1},
            manifest={"processor": "<script>alert(1)</script>"},
        )
    (tmp_path / "s/runs/<b>bold").mkdir()
    assert main(["report", str(tmp_path / "s")]) == 0
    html, markdown = page(tmp_path / "s"), (tmp_path / "s/report/report.md").read_text()
    for text in (html, markdown):
        assert "<img src=x" not in text and "<script>alert" not in text and "<b>bold" not in text
    assert "&lt;img src=x" in html


def test_empty_study_gives_a_page_that_says_what_is_missing(tmp_path):
    (tmp_path / "s/runs").mkdir(parents=True)
    assert main(["report", str(tmp_path / "s")]) == 0
    assert "There are no runs in s/runs yet." in page(tmp_path / "s")
    assert "No runs, so no verdicts." in page(tmp_path / "s")


@pytest.mark.parametrize(("seeds", "status"), [(1, "complete"), (2, "running")])
def test_few_or_unfinished_seeds_are_shown_not_errors(tmp_path, seeds, status):
    for actor in ("aan", "bptsan"):
        for seed in range(seeds):
            write_run(
                tmp_path / "s", actor=actor, seed=seed, status=status, stop=None if status == "complete" else 50_000
            )
    assert main(["report", str(tmp_path / "s")]) == 0
    assert (f"(n={seeds})" if status == "complete" else "2 running, the furthest 50,000 of 100,000") in page(
        tmp_path / "s"
    )


def test_a_task_without_reference_and_an_unknown_actor_are_shown_and_said(tmp_path):
    write_grid(tmp_path / "s", actors=("aan",), seeds=3)
    for seed in range(3):
        write_run(tmp_path / "s", seed=seed, actor="aan", label="my_actor", manifest={"actor": "my_actor"})
    shutil.copytree(tmp_path / "s/runs/td3/hopper", tmp_path / "s/runs/td3/swimmer")
    for path in (tmp_path / "s/runs/td3/swimmer").rglob("manifest.json"):
        path.write_text(path.read_text().replace('"env": "hopper"', '"env": "swimmer"'))
    for stage in ("collect", "statistics"):
        assert main([stage, str(tmp_path / "s")]) == 0
    html = json.dumps(tables_of(tmp_path / "s"))
    assert (
        "swimmer: no reference score" in html and "swimmer: no claim is about this task" in html and "my_actor" in html
    )


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["report", "nowhere"], "There is no folder nowhere"),
        (["figures", "{s}"], "has not been collected"),
        (["render", "{s}"], "run `python -m analysis statistics"),
        (["compare", "{s}:aan", "{s}:nobody"], "has no label 'nobody'; it has aan, bptsan"),
        (["compare", "aan", "bptsan"], "is no folder"),
        (["compare", "{s}", "{s}", "--algo", "sac"], "has no runs under sac"),
        (["report", "{s}", "--claims", "nothing.yaml"], "There is no claims file"),
    ],
)
def test_bad_input_gives_one_sentence_and_exit_2(tmp_path, capsys, arguments, sentence):
    write_grid(tmp_path / "s", actors=("aan", "bptsan"), seeds=1)
    assert main([argument.replace("{s}", str(tmp_path / "s")) for argument in arguments]) == 2
    error = capsys.readouterr().err
    assert sentence in error and "Traceback" not in error and error.strip().splitlines()[-1].startswith("error:")


def test_compare_labels_and_studies(tmp_path, capsys):
    write_grid(tmp_path / "a", {"bptsan": 1000.0}, actors=("aan", "bptsan"), seeds=6, noise=30)
    write_grid(tmp_path / "b", {"bptsan": 1000.0}, actors=("aan", "bptsan"), seeds=5, noise=30)
    assert main(["compare", "bptsan", "aan", "--study", str(tmp_path / "a")]) == 0
    assert "bptsan / aan" in capsys.readouterr().out
    table, _ = compare(side(str(tmp_path / "a"), None), side(str(tmp_path / "b"), None), "td3")
    assert (
        table.frame["labels"].tolist() == ["aan", "bptsan"]
        and "(n=6)" in table.frame["a"][0]
        and "(n=5)" in table.frame["b"][0]
    )
    table, notes = compare(side(f"{tmp_path / 'a'}:bptsan", None), side(f"{tmp_path / 'b'}:aan", None))
    assert table.frame["improvement"][0].startswith("1.00") and table.frame["p"][0] < 1e-4
    assert "actor.kind" in notes[0]


def test_compare_sets_any_two_sides_beside_one_another_with_one_note_about_what_differs(tmp_path, capsys):
    envs = ("hopper", "ant", "walker2d")
    write_grid(tmp_path / "a", {"bptsan": 500.0}, algos=("td3", "sac"), envs=envs, actors=("aan", "bptsan"), seeds=3)
    write_run(tmp_path / "b", label="mine", manifest={"actor": "mine"})
    a, b = tmp_path / "a", tmp_path / "b"
    table, notes = compare(side("td3", a), side("sac", a))
    assert table.frame["algorithm"].unique().tolist() == ["TD3 / SAC"] and len(table.frame) == 6
    assert table.frame["labels"].tolist() == ["aan", "bptsan"] * 3
    (note,) = [note for note in notes if "configurations differ" in note]
    assert "algo.alpha" in note or "algo." in note
    table, _ = compare(side("td3/bptsan", a), side("sac/aan", a))
    assert table.frame["labels"].tolist() == ["bptsan / aan"] * 3
    table, _ = compare(side(f"{a}:td3/bptsan", None), side(str(b), None))  # the other side has one label only
    assert table.frame["labels"].tolist() == ["bptsan / mine"]
    assert main(["compare", "bptsan", "aan", "--study", str(a)]) == 0
    assert capsys.readouterr().err.count("note:") == 1


@pytest.mark.parametrize("form", ["text", "csv", "latex"])
def test_compare_says_in_every_format_that_training_was_unequal(tmp_path, capsys, form):
    write_grid(tmp_path / "a", actors=("aan",), seeds=3)
    write_grid(tmp_path / "b", actors=("aan",), seeds=3, total_steps=50_000, interval=5_000)
    assert main(["compare", str(tmp_path / "a"), str(tmp_path / "b"), "--format", form]) == 0
    captured = capsys.readouterr()
    assert "unequal training, 100,000 against 50,000 steps: not comparable" in captured.out
    assert "unequal training" in captured.err


def test_a_sweep_has_a_line_per_coding(tmp_path):
    for coding in ("poisson", "deterministic"):
        write_run(tmp_path / "s", encoder=coding)
        write_run(tmp_path / "s", encoder=coding, label="r4", changes={"actor.lateral.radius": 4})
    for stage in ("collect", "figures"):
        assert main([stage, str(tmp_path / "s")]) == 0
    sweep = pd.read_csv(tmp_path / "s/figures/sweep-td3-actor.lateral.radius.csv")
    assert sweep[["line", "value"]].values.tolist() == [
        ["BPT-SAN [deterministic]", 2],
        ["BPT-SAN [deterministic]", 4],
        ["BPT-SAN [poisson]", 2],
        ["BPT-SAN [poisson]", 4],
    ]


def test_saturated_runs_are_named(tmp_path):
    run = write_run(tmp_path / "s")
    frame = pd.read_csv(run / "training.csv")
    frame["layer2_window_share"] = 0.001
    frame.to_csv(run / "training.csv", index=False)
    for stage in ("collect", "statistics"):
        assert main([stage, str(tmp_path / "s")]) == 0
    (note,) = [n for n in tables_of(tmp_path / "s")["notes"] if "saturated" in n]
    assert "layer 2 (0.1%)" in note and "layer 1" not in note


def test_analysis_imports_neither_torch_nor_the_training_code():
    code = "import sys, analysis.__main__, analysis.figures, analysis.statistics, analysis.render, analysis.compare;"
    code += (
        "bad = [m for m in sys.modules if m.split('.')[0] in ('torch', 'src', 'tensordict', 'torchrl')]; "
        "sys.exit(str(bad) if bad else 0)"
    )
    subprocess.run([sys.executable, "-c", code], check=True, cwd=ROOT)
