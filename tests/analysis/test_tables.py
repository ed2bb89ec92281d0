"""If these fail, a printed number reads as another one."""

import pytest

from analysis.tables import p_value


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        (0.0496, "0.0496"),
        (0.0504, "0.0504"),
        (0.049996, "0.049996"),
        (0.05, "0.050"),
        (0.04, "0.040"),
        (1e-5, "< 0.001"),
    ],
)
def test_a_p_value_never_reads_as_alpha_unless_it_is(value, shown):
    assert p_value(value) == shown


def test_another_alpha():
    assert p_value(0.0104, alpha=0.01) == "0.0104" and p_value(0.0496, alpha=0.01) == "0.050"
    assert p_value(float("nan")) == "–"
