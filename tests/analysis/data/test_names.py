"""If these fail, a long label pushes a figure off its page, or two labels look like one."""

from analysis.data.names import LONGEST, actor_name, task_name
from analysis.data.study import read_study
from benchmarks.synthetic import write_run


def test_long_names_are_shortened_and_stay_apart():
    one, other = "x" * 100 + "a" + "x" * 100, "x" * 100 + "b" + "x" * 100
    assert max(len(actor_name(one)), len(task_name(one))) <= LONGEST
    assert actor_name(one) != actor_name(other)


def test_short_names_stay_what_they_are_on_one_line():
    assert (actor_name("bptsan"), actor_name("mine"), actor_name("a\nb\x1b")) == ("BPT-SAN", "mine", "a b ")


def test_the_report_says_that_a_name_was_shortened(tmp_path):
    write_run(tmp_path / "s", label="x" * 200)
    (note,) = read_study(tmp_path / "s").warnings
    assert note.startswith("x" * 200) and f"is printed as {actor_name('x' * 200)}" in note
