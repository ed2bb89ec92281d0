"""What the figures over all tasks share: which arms they can show, and what they say where there are none."""

from __future__ import annotations

from analysis.data.names import task_name
from analysis.figures.drawing import Drawing
from analysis.figures.view import View
from analysis.statistics.aggregates import complete_arms, left_out, tasks_of


def arms_and_tasks(view: View) -> tuple[list[str], list[str]]:
    """The arms with finished runs on all of the tasks, and the tasks."""
    return complete_arms(view.cells, view.algo, view.claims), tasks_of(view.cells, view.algo, view.claims)


def tasks_in_words(tasks: list[str]) -> str:
    """``Hopper-v4, Ant-v4``."""
    return ", ".join(map(task_name, tasks)) or "no task"


def those_left_out(view: View) -> str:
    """A sentence that names the arms that are not shown; may be empty."""
    return left_out(view.cells, view.algo, view.claims)


def none(name: str, title: str, caption: str, view: View) -> list[Drawing]:
    """The drawing that says why there is none."""
    missing = "No actor has finished runs on every task that has a reference score." + those_left_out(view)
    return [Drawing(name, title, caption, missing=missing, folded=True)]
