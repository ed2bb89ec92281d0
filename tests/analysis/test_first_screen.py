"""If these fail, a reader takes a short or half-finished study for a test of the paper's claims."""

import json

from analysis.__main__ import main
from analysis.data.names import task_name
from analysis.data.study import read_study
from analysis.overview import overview, protocol
from benchmarks.synthetic import configuration, write_grid, write_run

TASKS = ("hopper", "walker2d", "halfcheetah", "ant")


def statistics(folder):
    for stage in ("collect", "statistics"):
        assert main([stage, str(folder)]) == 0
    content = json.loads((folder / "statistics/tables.json").read_text())
    return content, {table["name"]: table for table in content["tables"]}


def test_a_short_study_says_that_it_is_none_of_a_million_steps(tmp_path):
    write_grid(tmp_path / "s", actors=("aan", "bptsan"), seeds=3)
    write_run(tmp_path / "s", seed=3, status="running", stop=40_000)
    about = overview(read_study(tmp_path / "s"))
    assert about["title"] == "The claims at 100,000 steps"
    assert "Runs of 100,000 steps: the paper's claims are about 1,000,000" in about["caution"]
    assert (
        "100,000 steps a run (the paper: 1,000,000); 3 to 4 seeds per cell started (the paper: 10)" in about["status"]
    )
    assert "6 of 7 runs finished, 1 unfinished, the furthest at step 40,000" in about["status"]


def test_a_whole_study_is_about_the_papers_claims(tmp_path):
    write_run(tmp_path / "s", total_steps=1_000_000, interval=10_000, changes={"protocol.evaluation_episodes": 10})
    about = overview(read_study(tmp_path / "s"))
    assert about["title"] == "The paper's claims" and about["caution"] == ""


def test_settings_that_differ_from_the_papers_are_named_once(tmp_path):
    for env in ("hopper", "ant"):
        write_run(tmp_path / "s", env=env, changes={"normalize_observations": False})
        write_run(tmp_path / "s", env=env, actor="popsan", changes={"normalize_observations": False})
    write_run(tmp_path / "s", env="walker2d", changes={"env.max_episode_steps": 200, "normalize_observations": False})
    settings = overview(read_study(tmp_path / "s"))["settings"]
    assert settings.count("normalize_observations") == 1
    assert "normalize_observations false (the paper: true);" in settings
    assert "env.max_episode_steps 200 (the paper: 1,000) on Walker2d-v4" in settings
    assert "start_steps" not in settings


def test_the_protocol_file_is_what_conf_has():
    import yaml

    from analysis.data.flatten import flatten
    from benchmarks.synthetic import CONF

    paper = {f"protocol.{k}": v for k, v in yaml.safe_load((CONF / "protocol/paper.yaml").read_text()).items()}
    assert protocol()["steps"] == paper["protocol.total_steps"]
    for algo in ("td3", "sac"):
        flat = flatten(configuration(algo, "hopper", "bptsan")) | paper
        expected = protocol()["settings"] | protocol()["of_algorithm"][algo]
        assert {key: flat[key] for key in expected} == expected


def test_where_nothing_can_be_tested_one_sentence_names_the_reasons(tmp_path):
    write_run(tmp_path / "s", env="halfcheetah", status="running", stop=40_000)
    for seed in range(2):
        write_run(tmp_path / "s", actor="aan", seed=seed)
        write_run(tmp_path / "s", seed=seed)
    content, tables = statistics(tmp_path / "s")
    caption = tables["claims"]["caption"]
    answer = "Too few seeds to judge: no claim has more than 2 finished seeds in all of its arms; 5 are needed"
    assert content["overview"]["answer"].startswith(answer)
    assert json.dumps(content).lower().count("too few seeds to judge") == 2  # once said, once the name of a verdict
    assert caption.count("no runs on Walker2d-v4, Ant-v4 (N=111)") == 1
    assert "Verdict" not in tables["claims"]["headers"] + tables["claims_by_task"]["headers"]
    assert "too few seeds" not in json.dumps([tables["claims"]["rows"], tables["claims_by_task"]["rows"]])
    assert len((tmp_path / "s/statistics/claims_by_task.csv").read_text().splitlines()) == 21  # the CSV keeps them


def test_rows_without_an_estimate_stand_in_the_csv_only(tmp_path):
    write_grid(tmp_path / "s", {"bptsan": 500.0}, actors=("popsan", "bptsan"), seeds=5)
    _, tables = statistics(tmp_path / "s")
    assert len(tables["claims_by_task"]["rows"]) == 1 and len(tables["claims"]["rows"]) == 5
    assert "19 rows without an estimate stand in the CSV only" in tables["claims_by_task"]["caption"]
    assert "no runs on Walker2d-v4, HalfCheetah-v4, Ant-v4" in tables["claims"]["caption"]
    assert "interim, 5 of 10 seeds" in tables["claims"]["rows"][0][-1]


def test_the_main_table_has_a_row_for_every_label_and_a_column_for_every_task(tmp_path):
    write_run(tmp_path / "s", status="running", stop=40_000, manifest={"step": 43_500})
    write_run(tmp_path / "s", env="ant", label="mine", manifest={"actor": "mine"})
    _, tables = statistics(tmp_path / "s")
    assert tables["main"]["headers"] == ["Algorithm", "Actor", "Hopper-v4", "Ant-v4 (N=111)"]
    mine = ["TD3", "mine", "no run", tables["main"]["rows"][1][-1]]
    assert tables["main"]["rows"] == [["TD3", "BPT-SAN", "running, 43,500 of 100,000", "no run"], mine]
    assert mine[-1].endswith("(n=1)")
    assert "No runs on Walker2d-v4, HalfCheetah-v4." in tables["main"]["caption"]


def test_the_forest_plot_says_what_the_sentence_says(tmp_path):
    write_grid(tmp_path / "s", {"bptsan": 30.0}, envs=TASKS, actors=("aan", "popsan", "bptsan"), seeds=10, noise=60)
    content, _ = statistics(tmp_path / "s")
    (forest,) = content["overview"]["forests"]
    claims = {row["label"]: row for row in forest["rows"] if row["pooled"]}
    assert len(claims) == 2 and "Without comparable finished runs: BPT-SAN beats itself" in forest["caption"]
    for label, row in claims.items():
        assert row["verdict"] in content["overview"]["verdicts"] and row["n"] == "10"
        assert f"{row['verdict']}: " in content["overview"]["answer"] and label in content["overview"]["answer"]
        assert "over 4 tasks" in row["remark"] and 0 < row["at"] < 400
    assert any("relevant" in row["verdict"] for row in claims.values())
    assert [row["label"] for row in forest["rows"] if not row["pooled"]] == [*map(task_name, TASKS)] * 2


def test_what_could_mislead_stands_before_the_numbers(tmp_path):
    for seed in range(3):
        write_run(tmp_path / "s", actor="aan", seed=seed, noise=200, interval=5_000)
        write_run(tmp_path / "s", seed=seed, noise=200, interval=5_000)
    content, _ = statistics(tmp_path / "s")
    first = "\n".join(content["overview"]["first"])
    assert "Runs of 100,000 steps" in first
    assert "actors learn at different rates (0.001 for AAN; 0.0001 for all others)" in first
    assert "of the variance between seeds, the scatter of a run's last evaluations explains at most" in first
    assert not any("learn" in note for note in content["notes"])


def test_unfinished_failed_and_diverged_runs_are_noted_by_cell(tmp_path):
    write_run(tmp_path / "s")
    write_run(tmp_path / "s", seed=1, status="interrupted", stop=30_000)
    failure = {"kind": "ValueError", "message": "no such\nthing", "step": 20_000}
    write_run(tmp_path / "s", seed=2, status="failed", stop=20_000, manifest={"failure": failure})
    write_run(tmp_path / "s", seed=3, status="diverged", stop=50_000)
    content, _ = statistics(tmp_path / "s")
    notes = "\n".join(content["notes"])
    where = "TD3, Hopper-v4, BPT-SAN: 1 of 4 runs"
    assert f"{where} failed (seed 2 at 20,000 of 100,000 steps: ValueError: no such thing)." in notes
    assert f"{where} unfinished (seed 1 interrupted, 30,000 of 100,000 steps)." in notes
    assert f"{where} diverged (seed 3 at 50,000 of 100,000 steps, its last value carried forward)." in notes


def test_the_rule_is_computed_from_the_studys_own_claims_file(tmp_path):
    write_grid(tmp_path / "s", actors=("aan", "popsan", "bptsan"), seeds=5)
    (tmp_path / "s/claims.yaml").write_text(
        "alpha: 0.01\npower: 0.9\nplanned_seeds: 5\ninterim_alpha: 0.002\nsmallest_effect: 7\n"
        "tasks: [hopper]\nclaims:\n"
        "  - {name: a, kind: difference, source: paper, text: A, better: bptsan, worse: aan}\n"
        "  - {name: b, kind: difference, source: user, text: B, better: bptsan, worse: popsan}\n"
    )
    assert main(["report", str(tmp_path / "s")]) == 0
    content = json.loads((tmp_path / "s/statistics/tables.json").read_text())
    rule = " ".join(content["overview"]["rule"])
    assert "adjusted p below 0.01" in rule and "adjusted p below 0.002" in rule and "within ±7 points" in rule
    assert "detected with 90% power at the first of 1 Holm steps" in rule
    assert "Seeds 0 to 4 on Hopper-v4 decide." in rule
    tables = {table["name"]: table for table in content["tables"]}
    source = tables["claims"]["headers"].index("Source")
    assert [row[source] for row in tables["claims"]["rows"]] == ["declared", "yours"]
    pairs = (tmp_path / "s/figures/improvement-td3.csv").read_text()  # the figures follow the same file
    assert "BPT-SAN > AAN" in pairs and "w/o" not in pairs
