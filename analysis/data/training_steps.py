"""How long the runs of a task are trained, and which runs that leaves out of comparisons.

The training steps of an algorithm and task are what most of its finished runs of the paper's actors were asked for (of
two equally frequent lengths the longer): one longer or shorter run does not move them.
"""

from __future__ import annotations

from collections import Counter

from analysis.data.arms import arm_of
from analysis.data.reading import Run


def training_steps_by_task(runs: list[Run]) -> dict[tuple[str, str], int]:
    """``(algo, env)`` to steps; where no run of the paper's actors has finished, from what there is."""
    places = dict.fromkeys((run.manifest["algo"], run.manifest["env"]) for run in runs)
    return {
        place: _most_frequent([run for run in runs if (run.manifest["algo"], run.manifest["env"]) == place])
        for place in places
    }


def _most_frequent(runs: list[Run]) -> int:
    finished = [run for run in runs if run.counts_as == "finished"]
    counted = [run for run in runs if run.counts_as != "unfinished"]
    for group in ([run for run in finished if arm_of(run)[1]], finished, counted, runs):
        if group:
            lengths = Counter(int(run.manifest["total_steps"]) for run in group)
            return max(lengths, key=lambda steps: (lengths[steps], steps))
    raise ValueError("a task without runs has no number of training steps")


def unequal_training(run: Run, training_steps: int) -> str:
    """Why a run that would count does not; empty if it does."""
    asked = int(run.manifest["total_steps"])
    if run.counts_as == "unfinished" or asked == training_steps:
        return ""
    return (
        f"runs/{run.path}: it was asked for {asked:,} steps, others of its task for {training_steps:,}; "
        "results after unequal training are not compared, so it stands in curves only, among the unfinished."
    )


def missing_at_the_end(run: Run, training_steps: int) -> str:
    """A sentence where evaluations of the last 10% of the steps, whose mean is the final performance, are not there."""
    if run.counts_as != "finished":
        return ""
    wanted = [step for step in due(run, training_steps) if 10 * step > 9 * training_steps]
    missing = sorted(set(wanted) - set(run.evaluations["step"]))
    if not missing:
        return ""
    return (
        f"runs/{run.path}: {len(missing)} of the {len(wanted)} evaluations in the last 10% of its steps are missing "
        f"(step {', '.join(f'{step:,}' for step in missing[:3])}); its final performance is the mean of the others."
    )


def due(run: Run, training_steps: int) -> list[int]:
    """The steps at which a run is evaluated: every interval, and at the end."""
    interval = max(1, int(run.config["protocol"].get("evaluation_interval", training_steps) or training_steps))
    return sorted({*range(0, training_steps + 1, interval), training_steps})
