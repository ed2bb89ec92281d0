"""What looks wrong only when the runs of a study are held beside one another; nothing is left out for it."""

from __future__ import annotations

from collections import Counter

import pandas as pd

from analysis.data.arms import arm_of
from analysis.data.flatten import ABSENT
from analysis.data.mixed import cell_of, differences, folder_and_names, listed
from analysis.data.names import ACTORS, LONGEST, ordered_arms, printable
from analysis.data.reading import Run


def cross_checks(runs: list[Run], evaluations: pd.DataFrame) -> list[str]:
    """Sentences about the runs of the sound cells and their frame of evaluations."""
    return [*_shortened(runs), *_edited(runs), *_copies(evaluations), *_several_blas(runs), *_several_backends(runs)]


def _shortened(runs: list[Run]) -> list[str]:
    return [
        f"{arm} is printed as {printable(arm)}: figures have no room for {len(arm)} characters."
        for arm in dict.fromkeys(arm_of(run)[0] for run in runs)
        if arm not in ACTORS and len(arm) > LONGEST
    ]


def _edited(runs: list[Run]) -> list[str]:
    """A sentence for each run whose ``config.yaml`` contradicts that of its cell's first run, though the hashes agree.

    The hash was made of what ran, so the run counts. Two versions of the training code may write the same configuration
    with another set of keys: only keys that both have contradict one another.
    """
    firsts: dict[tuple[str, str, str], Run] = {}
    sentences = []
    for run in runs:
        first = firsts.setdefault(cell_of(run), run)
        found = [one for one in differences(first, run) if ABSENT not in one[1:]]
        if found:
            where, names = folder_and_names(first, run)
            sentences.append(
                f"runs/{where}: {names} have the same cell_hash, and their config.yaml differ in {listed(found)}: "
                "somebody has changed one of the two."
            )
    return sentences


def _copies(evaluations: pd.DataFrame) -> list[str]:
    """Seeds of a cell with the same returns up to rounding: chance does not do that, a copied folder does."""
    found = []
    measured = evaluations[~evaluations["carried"].astype(bool)]
    for (algo, env, arm), cell in measured.groupby(["algo", "env", "arm"], sort=False):
        alike: dict[str, list[str]] = {}
        for seed, run in cell.groupby("seed"):
            if len(run) > 1:
                curve = " ".join(f"{step}:{value:.9e}" for step, value in zip(run["step"], run["return"]))
                alike.setdefault(curve, []).append(str(seed))
        found += [
            f"{algo}/{env}/{arm}: seeds {', '.join(seeds)} have the same returns at every evaluation, as if they were "
            "copies of one run; n counts each of them."
            for seeds in alike.values()
            if len(seeds) > 1
        ]
    return found


def _several_backends(runs: list[Run]) -> list[str]:
    """The compiled engine and plain PyTorch compute the same updates, up to the last bits of a sum."""
    used: dict[str, Counter[str]] = {}
    for run in runs:
        if backend := run.manifest.backend:
            used.setdefault(backend, Counter())[arm_of(run)[0]] += 1
    if len(used) < 2:
        return []
    shown = "; ".join(
        f"{backend} in {sum(arms.values())} ({', '.join(map(printable, ordered_arms(arms)))})"
        for backend, arms in sorted(used.items())
    )
    return [f"The runs were computed by several backends ({shown}): the last bits of their results differ by backend."]


def _several_blas(runs: list[Run]) -> list[str]:
    """Results agree bit by bit only where the same library made the matrix products."""
    used = Counter(blas for run in runs if (blas := run.manifest.blas.get("library")))
    if len(used) < 2:
        return []
    shown = ", ".join(f"{library} in {count}" for library, count in sorted(used.items()))
    return [f"The runs used several BLAS libraries ({shown} runs): the last bits of their results differ by library."]
