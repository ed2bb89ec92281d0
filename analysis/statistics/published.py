"""The study beside published numbers: the same algorithm, actor, task, number of steps and statistic, and no others."""

from __future__ import annotations

from collections.abc import Iterable

import pandas as pd

from analysis import metrics
from analysis.data.arms import algorithm_and_arm
from analysis.data.cells import Cell
from analysis.data.names import actor_name, algorithm_name, ordered_tasks, task_name
from analysis.published import NOT_STATED, TASKS, PublishedScore, Statistic, published
from analysis.statistics.performance import cell_names, mean_and_std
from analysis.tables import Column, Table, number, spread, text

_PUBLISHED_TASKS = {"hopper": "Hopper", "walker2d": "Walker2d", "halfcheetah": "HalfCheetah", "ant": "Ant"}
_Pair = tuple[Cell, PublishedScore]


def published_table(cells: list[Cell]) -> Table:
    """Ours beside each published number of its like; where there is none, which requirement fails."""
    pairs, empty = matching(cells, published())
    columns: list[Column] = [
        ("algorithm", "Algorithm", text),
        ("task", "Task", text),
        ("actor", "Actor", text),
        ("statistic", "Statistic", text),
        ("ours", "Here", str),
        ("published", "Published", str),
        ("published_task", "Published on", text),
        ("published_actor", "Published as", text),
        ("source", "Source", text),
    ]
    caption = (
        "Beside one another stand equal algorithms, actors, tasks, numbers of steps and statistics only. max_of_mean: "
        "the largest value of the seeds' mean curve; mean_of_max: the mean of their own maxima; final: here the last "
        "10% of the steps. v4 has v3's dynamics on another simulator. Protocols differ otherwise, in batch sizes, "
        "learning rates or normalisation."
    )
    if any(score.task == "ant" and score.version == "v3" for _, score in pairs):
        caption += (
            f" Ant-v3's contact values are 0 on MuJoCo 2.0 and later, as those of {task_name('ant_zero_contact')}."
        )
    frame = (
        pd.DataFrame([_row(*pair) for pair in pairs]) if pairs else pd.DataFrame(columns=[key for key, *_ in columns])
    )
    return Table("published", "statistics", "Beside published numbers", caption, frame, columns, empty)


def matching(cells: list[Cell], scores: Iterable[PublishedScore]) -> tuple[list[_Pair], str]:
    """Every pair of a cell and a published number of its like, in the order of the cells; and, where there is none, a
    sentence that says which requirement fails.
    """
    if not cells:
        return [], "No runs, so nothing stands beside published numbers."
    pairs = [(cell, score) for cell in cells for score in scores if cell.algo == _algorithm_and_arms(score)[0]]
    if not pairs:
        return [], f"No published number is of {_listed(algorithm_name(cell.algo) for cell in cells)}."
    every, pairs = pairs, [(cell, score) for cell, score in pairs if cell.arm in _algorithm_and_arms(score)[1]]
    if not pairs:
        shown = _listed(actor_name(cell.arm) for cell, _ in every)
        return [], f"No published number under these algorithms is of an actor of this study ({shown})."
    every, pairs = pairs, [(cell, score) for cell, score in pairs if score.beside_task(cell.env)]
    if not pairs:
        tasks = _listed(map(task_name, ordered_tasks(cell.env for cell, _ in every)))
        return [], f"This study's tasks are {tasks}; published numbers of its actors are on {_listed_tasks(every)}."
    every, pairs = pairs, [(cell, score) for cell, score in pairs if score.beside_steps(cell.training_steps)]
    if not pairs:
        ours = _steps(cell.training_steps for cell, _ in every)
        theirs = _steps(score.steps for _, score in every if score.steps)
        return [], f"This study's runs have {ours} steps; published numbers of its actors are after {theirs}."
    pairs = [(cell, score) for cell, score in pairs if score.statistic is not None]
    if not pairs:
        return [], "The sources of the numbers that could stand here do not say which statistic they are."
    pairs = [(cell, score) for cell, score in pairs if cell.n]
    return pairs, "" if pairs else "No run that could stand beside a published number has finished."


def _algorithm_and_arms(score: PublishedScore) -> tuple[str, tuple[str, ...]]:
    """The algorithm and the arms of a study that a published number is about."""
    names = [algorithm_and_arm(score.algorithm, label) for label in score.labels]
    return names[0][0], tuple(arm for _, arm in names)


def _row(cell: Cell, score: PublishedScore) -> dict[str, object]:
    mean, std = _ours(cell, score.statistic)
    name = f"{_PUBLISHED_TASKS[score.task]}-{score.version or f'v? ({NOT_STATED})'}"
    return {
        **cell_names(cell),
        "steps": cell.training_steps,
        "statistic": str(score.statistic),
        "mean": mean,
        "std": std,
        "n": cell.n,
        "published_mean": score.mean,
        "published_std": score.std,
        "published_n": score.seeds,
        "published_steps": score.steps,
        "ours": spread(mean, std, cell.n),
        "published": score_words(score),
        "published_task": f"{name} (N={score.dimensions})" if score.dimensions else name,
        "published_actor": score.actor,
        "source": score.source,
    }


def _ours(cell: Cell, statistic: Statistic | None) -> tuple[float, float]:
    if statistic is Statistic.FINAL:
        return mean_and_std(cell.final)
    of_mean = statistic is Statistic.MAX_OF_MEAN
    best = metrics.max_of_mean(cell.steps, cell.returns) if of_mean else metrics.mean_of_max(cell.returns)
    return best.value, best.std


def score_words(score: PublishedScore) -> str:
    """``3,599 ± 68 (n=10)``, and what the source does not say."""
    show = number()
    std = "" if score.std is None else f" ± {show(score.std)}"
    seeds = f"n {NOT_STATED}" if score.seeds is None else f"n={score.seeds}"
    return f"{show(score.mean)}{std} ({seeds}{f', std {NOT_STATED}' if score.std is None else ''})"


def _listed(names: Iterable[str]) -> str:
    return ", ".join(dict.fromkeys(names))


def _listed_tasks(pairs: list[_Pair]) -> str:
    present = {score.task for _, score in pairs}
    return ", ".join(_PUBLISHED_TASKS[task] for task in TASKS if task in present)


def _steps(steps: Iterable[int]) -> str:
    return " or ".join(f"{value:,}" for value in sorted(set(steps)))
