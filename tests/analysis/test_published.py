"""If these fail, a published number is not what its source says, or docs/actors.md says another."""

from pathlib import Path

import pytest
import yaml

from analysis.data.errors import InputError
from analysis.published import FILE, NOT_STATED, TASKS, Statistic, published
from analysis.references import references

ROOT = Path(__file__).resolve().parents[2]
#: The order of docs/actors.md.
COLUMNS = ("ant", "halfcheetah", "hopper", "walker2d")


def found(**wanted):
    return [s for s in published() if all(getattr(s, name) == value for name, value in wanted.items())]


def test_each_number_has_its_facts_and_unknown_ones_stay_unknown():
    (score,) = found(source="PopSAN paper (Tang et al., CoRL 2020)", task="hopper")
    assert (score.algorithm, score.labels, score.version, score.steps) == ("td3", ("popsan",), "v3", 1_000_000)
    assert (score.statistic, score.mean, score.std, score.seeds) == (Statistic.MAX_OF_MEAN, 3599, 68, None)
    (rerun,) = found(actor="PT-CLIF", statistic=Statistic.MEAN_OF_MAX)
    assert (rerun.mean, rerun.std, rerun.seeds, rerun.steps, rerun.version) == (2120, 1721, 5, None, None)
    assert len(found(algorithm="td3_proxy")) == 13 and len(found(algorithm="sac")) == 4 and len(published()) == 57


def test_an_ant_is_the_task_with_as_many_dimensions_and_v5_is_another_task():
    (narrow,) = found(task="ant", actor="PT-LIF")
    (wide,) = found(task="ant", actor="Pop-DAN")
    assert [env for env in ("ant", "ant_zero_contact", "ant_no_contact", "ant_v5") if narrow.beside_task(env)] == [
        "ant_no_contact"
    ]
    assert wide.beside_task("ant") and wide.beside_task("ant_zero_contact") and not wide.beside_task("ant_no_contact")
    assert all(not score.beside_task("hopper_v5") for score in published())


def test_random_steps_that_a_source_does_not_count_may_be_counted_here():
    (score,) = found(task="hopper", actor="PT-LIF")
    assert [steps for steps in (100_000, 1_000_000, 1_025_000) if score.beside_steps(steps)] == [1_000_000, 1_025_000]
    (rerun,) = found(statistic=Statistic.MEAN_OF_MAX)
    assert not rerun.beside_steps(1_000_000)


def test_the_hundred_of_normalised_scores_is_one_of_these():
    for algo, source in (("td3", "Proxy Target"), ("sac", "Spinning Up")):
        of_aan = [s for s in published() if source in s.source and s.algorithm == algo and "aan" in s.labels]
        assert {s.task: s.mean for s in of_aan} == {task: references()["aan_reference"][algo][task] for task in TASKS}
        assert {s.steps for s in of_aan} == {references()["aan_reference"][algo]["steps"]}


def docs_table():
    """What docs/actors.md must hold: a row for each actor of each source."""
    rows = {}
    for score in published():
        shown = f"{score.mean:g}" + ("" if score.std is None else f" ({score.std:g})")
        rows.setdefault((score.source, score.algorithm, score.actor), {"facts": score})[score.task] = shown
    lines, said = [], ""
    for (source, algorithm, actor), row in rows.items():
        score = row["facts"]
        random = f" after {score.random_steps:,} random ones" if score.random_steps else ""
        steps = f"{score.steps:,} steps{random}" if score.steps else None
        facts = [score.version, steps, score.seeds and f"{score.seeds} seeds"]
        words = f"{source}: {', '.join(fact or f'{name} {NOT_STATED}' for name, fact in zip(NAMES, facts))}"
        words = f"{words}; {score.statistic}"
        cells = [words if words != said else "", algorithm, actor, *(row.get(task, "") for task in COLUMNS)]
        said = words
        lines.append(f"| {' | '.join(cells)} |")
    return lines


NAMES = ("version", "steps", "seeds")


def test_docs_actors_shows_exactly_these_numbers():
    text = (ROOT / "docs/actors.md").read_text(encoding="utf-8")
    section = text[text.index("## Published numbers") :]
    shown = [line for line in section.splitlines() if line.startswith("|")][2:]
    assert shown == docs_table(), "docs/actors.md should have:\n" + "\n".join(docs_table())


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"seeds": "five"}, "tables 1, seeds: should be a valid integer, found 'five'"),
        ({"statistic": "best"}, "tables 1, statistic: should be 'max_of_mean', 'mean_of_max' or 'final', found 'best'"),
        ({"step": 5}, "there is no key tables 1, step"),
        ({"version": ...}, "the key tables 1, version is missing"),
        ({"rows": [{"algorithm": "td3", "actor": "x"}]}, "the key tables 1, rows 1, labels is missing"),
        ({"rows": []}, "tables 1, rows: List should have at least 1 item"),
    ],
)
def test_a_mistake_gives_one_sentence(tmp_path, change, sentence):
    table = yaml.safe_load(FILE.read_text())["tables"][0] | change
    path = tmp_path / "published.yaml"
    path.write_text(yaml.safe_dump({"tables": [{k: v for k, v in table.items() if v is not ...}]}))
    with pytest.raises(InputError) as caught:
        published(path)
    assert sentence in str(caught.value) and str(caught.value).startswith("published.yaml: ")
