"""If these fail, a study is judged by a rule that nobody declared."""

import pytest
import yaml

from analysis.claims_file import FILE, Family, claims_path, read_claims
from analysis.data.errors import InputError
from benchmarks.synthetic import LEVELS

GOOD = {
    "alpha": 0.05, "power": 0.8, "planned_seeds": 10, "interim_alpha": 0.001, "smallest_effect": 15,
    "tasks": ["hopper"],
    "claims": [{"name": "mine", "kind": "difference", "source": "user", "better": "a", "worse": "b"}],
}  # fmt: skip


def written(folder, **changes):
    path = folder / "claims.yaml"
    path.write_text(yaml.safe_dump({key: value for key, value in (GOOD | changes).items() if value is not None}))
    return path


def claim(**changes):
    return [{key: value for key, value in (GOOD["claims"][0] | changes).items() if value is not None}]


def test_the_projects_file_holds_the_papers_claims_and_methods_rule():
    claims = read_claims()
    assert set(claims.tasks) == set(LEVELS)
    assert (claims.alpha, claims.planned_seeds, claims.interim_alpha, claims.smallest_effect) == (0.05, 10, 0.001, 15)
    assert claims.baselines == ("aan", "popsan")
    assert [c.weights for c in claims.claims] == [(1.0, -1.0)] * 4 + [(1.0, -1.0, -1.0, 1.0)]
    assert {c.family for c in claims.claims} == {Family.DECLARED}


def test_a_studys_own_file_holds_and_a_given_one_before_it(tmp_path):
    assert claims_path(tmp_path) == FILE
    own = written(tmp_path)
    assert claims_path(tmp_path) == own
    assert claims_path(tmp_path, FILE) == FILE
    assert read_claims(own).tasks_planned and not read_claims(FILE).tasks_planned


def test_without_baselines_the_papers_are_meant(tmp_path):
    assert read_claims(written(tmp_path)).baselines == ("aan", "popsan")
    assert read_claims(written(tmp_path, baselines=["mine"])).baselines == ("mine",)


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"planned_seeds": 4}, "planned_seeds should be greater than or equal to 5, found 4"),
        ({"planned_seeds": 7.5}, "planned_seeds should be a valid integer, found 7.5"),
        ({"interim_alpha": 0.05}, r"interim_alpha \(0.05\) should be below alpha \(0.05\)"),
        ({"smallest_effect": 0}, "smallest_effect should be greater than 0, found 0"),
        ({"smallest_effect": float("inf")}, "smallest_effect should be a finite number"),
        ({"alpha": 2.0}, "alpha should be less than 1, found 2.0"),
        ({"alpha": None}, "the key alpha is missing"),
        ({"reference_scores": {"swimmer": {"td3": "x"}}}, "reference_scores.swimmer.td3 should be a valid number"),
        ({"reference_scores": {"swimmer": {"random": 9, "td3": 3}}}, "td3 on swimmer should be above random"),
        ({"minimum_seeds": 3}, "there is no key minimum_seeds"),
        ({"tasks": []}, "tasks"),
        ({"tasks": ["hopper", "hopper"]}, "task hopper stands there twice"),
        ({"claims": claim() * 2}, "claim mine stands there twice"),
        ({"claims": claim(kind="guess")}, "claim mine: kind should be difference or interaction, found 'guess'"),
        ({"claims": claim(kind=None)}, "claim mine: kind should be difference or interaction, found None"),
        ({"claims": claim(worse=None)}, "claim mine: the key worse is missing"),
        ({"claims": claim(bse="c")}, "claim mine: there is no key bse"),
        ({"claims": claim(worse="a")}, "claim mine names the same label twice"),
        ({"claims": claim(source="me")}, "claim mine: source should be 'paper' or 'user', found 'me'"),
        ({"claims": ["x"]}, "claim 1: should be a mapping"),
        ({"claims": claim(removes=3)}, "claim mine: removes should be a valid list, found 3"),
        ({"claims": claim(removes="")}, "claim mine: removes.1 String should have at least 1 character"),
    ],
)
def test_nonsense_gives_one_sentence(tmp_path, changes, sentence):
    with pytest.raises(InputError, match=sentence) as caught:
        read_claims(written(tmp_path, **changes))
    assert str(caught.value).startswith("claims.yaml: ") and "\n" not in str(caught.value)


@pytest.mark.parametrize(("content", "sentence"), [("- a", "expected the keys"), ("a: [", "not valid YAML")])
def test_a_file_that_is_no_mapping_gives_one_sentence(tmp_path, content, sentence):
    (tmp_path / "claims.yaml").write_text(content)
    with pytest.raises(InputError, match=sentence):
        read_claims(tmp_path / "claims.yaml")
