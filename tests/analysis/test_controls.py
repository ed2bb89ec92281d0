"""If these fail, a difference passes for the actor's alone, or a control for what it is not."""

import json

import pytest
import yaml

from analysis.__main__ import main
from analysis.claims_file import read_claims
from benchmarks.synthetic import write_run

FAST = "bptsan-algo.actor_learning_rate=0.001"
RULE = {"alpha": 0.05, "power": 0.8, "planned_seeds": 5, "interim_alpha": 0.001, "smallest_effect": 15}


def claim(name, better, worse, **more):
    return {"name": name, "kind": "difference", "source": "user", "text": name, "better": better, "worse": worse} | more


CLAIMS = [
    claim("plain", "bptsan", "aan"),
    claim("same rate", FAST, "aan", removes="the learning rate"),
    claim("same size", "bptsan", "aan_matched", removes=["the number of parameters"]),
    claim("both", FAST, "aan_matched", removes=["the learning rate", "the number of parameters"]),
    claim("code", "bptsan", "popsan", removes="the population code"),
]


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """BPT-SAN at its own rate and at the AAN's; an AAN, and one that is as large as BPT-SAN within 2 %."""
    folder = tmp_path_factory.mktemp("controls") / "s"
    for seed in range(3):
        for actor, label, size in (
            ("aan", "aan", 71_942),
            ("aan_matched", "aan_matched", 127_656),
            ("popsan", "popsan", 125_406),
            ("bptsan", "bptsan", 127_442),
            ("bptsan", FAST, 127_442),
        ):
            changes = {"algo.actor_learning_rate": 0.001} if label == FAST else {}
            write_run(
                folder,
                actor=actor,
                label=label,
                seed=seed,
                noise=50,
                changes=changes,
                manifest={"parameters": {"actor": size, "critic": 1}},
            )
    write(folder, CLAIMS)
    assert main(["report", str(folder)]) == 0
    return folder


def write(folder, claims):
    (folder / "claims.yaml").write_text(yaml.safe_dump(RULE | {"tasks": ["hopper"], "claims": claims}))


def content(folder):
    tables = json.loads((folder / "statistics/tables.json").read_text())
    return tables["overview"], {table["name"]: table for table in tables["tables"]}


def test_each_claim_says_beside_its_effect_what_it_removes_and_what_is_left(study):
    (forest,) = content(study)[0]["forests"]
    said = {row["label"]: (row["control"], row["remark"]) for row in forest["rows"] if row["pooled"]}
    assert said == {
        "plain": ("", "over 1 task; confounded by the learning rate and the number of parameters"),
        "same rate": ("removes the learning rate", "over 1 task; confounded by the number of parameters"),
        "same size": ("removes the number of parameters", "over 1 task; confounded by the learning rate"),
        "both": ("removes the learning rate and the number of parameters", "over 1 task"),
        "code": ("removes the population code", "over 1 task"),  # 1.6 % more parameters are no other size
    }
    for page in ("index.html", "report.md"):
        words = (study / "report" / page).read_text()
        assert all(control in words and remark in words for control, remark in said.values())


def test_the_first_notes_name_each_confound_and_the_claims_without_it(study):
    first = "\n".join(content(study)[0]["first"])
    assert "different rates (0.001 for AAN, AAN (matched); 0.0001 for all others)" in first  # FAST says its own
    assert "a difference between them is not the actor's alone. Removed in “same rate” and “both”." in first
    assert (
        "by more than 2% in the number of parameters in “plain” and “same rate”. Removed in “same size” and “both”"
        in first
    )
    assert "is to remove" not in first


def test_the_table_of_claims_has_a_column_for_controls_and_the_values_of_confounds(study):
    table = next(table for table in content(study)[1].values() if "Removes" in table["headers"])
    removes = [row[table["headers"].index("Removes")] for row in table["rows"]]
    assert removes == ["", "the learning rate", "the number of parameters",
                       "the learning rate, the number of parameters", "the population code"]  # fmt: skip
    assert table["rows"][0][-1] == (
        "confounded by the learning rate (0.0001 for BPT-SAN, 0.001 for AAN) and the number of parameters "
        "(127,442 for BPT-SAN, 71,942 for AAN)"
    )


def test_a_control_that_does_not_remove_what_it_says_is_named(study):
    write(study, [claim("wrong", "bptsan", "aan", removes=["the learning rate", "the spikes"])])
    assert main(["statistics", str(study)]) == 0
    first = "\n".join(content(study)[0]["first"])
    assert (
        "“wrong” is to remove the learning rate, but its runs differ in it: confounded by the learning rate (0.00"
        in first
    )
    assert "No claim of this study removes that." in first and "remove the spikes" not in first
    write(study, CLAIMS)


def test_without_controls_the_table_has_no_such_column(study):
    write(study, CLAIMS[:1])
    assert main(["statistics", str(study)]) == 0
    assert all("Removes" not in table["headers"] for table in content(study)[1].values())
    write(study, CLAIMS)


def test_removes_is_a_name_or_a_list_of_names(study):
    assert [one.removes for one in read_claims(study / "claims.yaml").claims][:3] == [
        (),
        ("the learning rate",),
        ("the number of parameters",),
    ]
