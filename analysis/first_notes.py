"""The notes that stand before any number: what could make a reader take the numbers for more than they are."""

from __future__ import annotations

import numpy as np
import pandas as pd

from analysis.data.cells import Cell, select
from analysis.data.confounds import LEARNING_RATE, MATCHED, PARAMETERS
from analysis.data.names import actor_name, algorithm_name, task_name
from analysis.data.study import Study, flat_configuration
from analysis.verdicts import ClaimResult, Judgement
from analysis.verdicts.wording import confound_words

MOST_CLAIMS = 2


def first_notes(study: Study, cells: list[Cell], judgement: Judgement) -> list[str]:
    """Refused cells, confounds and which claims remove them, evaluation noise, diverged runs: one sentence each."""
    found = []
    if study.refused:
        shown = [
            f"{actor_name(cell.arm)} on {task_name(cell.env)} with {algorithm_name(cell.algo)}"
            for cell in study.refused
        ]
        found.append(f"Refused, because they mix configurations (the notes name the keys): {', '.join(shown)}.")
    for algo in dict.fromkeys(cell.algo for cell in cells):
        here = select(cells, algo)
        results = [result for result in judgement.results if result.algo == algo and result.covered]
        sentences = [_learning_rates(study, here, results), _parameters(results), *_not_removed(results)]
        found += [sentence for sentence in (*sentences, _noise(here), _diverged(here)) if sentence]
    return found


def _learning_rates(study: Study, here: list[Cell], results: list[ClaimResult]) -> str:
    """Whether all actors of an algorithm learn at one rate; the published comparison does not. Labels that say their
    rate have no part in it.
    """
    rates: dict[float, list[str]] = {}
    said = study.runs["changed_keys"].str.contains(r'"(?:algo\.actor_|actor\.)learning_rate"')
    declared = set(study.runs.loc[said, "arm"])
    for cell in here:
        rate = flat_configuration(study, cell.algo, cell.env, cell.arm).get("algo.actor_learning_rate")
        if rate is None or cell.arm in declared:
            continue
        if actor_name(cell.arm) not in rates.setdefault(float(rate), []):
            rates[float(rate)].append(actor_name(cell.arm))
    name = algorithm_name(here[0].algo)
    if not rates:
        return ""
    if sum(map(len, rates.values())) < 2:
        return ""
    if len(rates) == 1:
        return f"{name}: all actors learn at one rate, {next(iter(rates)):g}."
    fewest = sorted(rates, key=lambda rate: len(rates[rate]))
    shown = [f"{rate:g} for {', '.join(rates[rate])}" for rate in fewest[:-1]]
    return (
        f"{name}: actors learn at different rates ({'; '.join(shown)}; {fewest[-1]:g} for all others), as in the "
        f"published comparison: a difference between them is not the actor's alone.{_removed(LEARNING_RATE, results)}"
    )


def _parameters(results: list[ClaimResult]) -> str:
    """Which claims compare actors of different sizes."""
    names = [result.claim.text for result in results if PARAMETERS in result.confounds]
    if not names:
        return ""
    return (
        f"{algorithm_name(results[0].algo)}: actors differ by more than {MATCHED:.0%} in the number of parameters in "
        f"{_quoted(names)}.{_removed(PARAMETERS, results)}"
    )


def _removed(confound: str, results: list[ClaimResult]) -> str:
    """Which claims do without a confound, by their ``removes`` and by their runs."""
    if not results:
        return ""
    names = [one.claim.text for one in results if confound in one.claim.removes and confound not in one.confounds]
    return f" Removed in {_quoted(names)}." if names else " No claim of this study removes that."


def _not_removed(results: list[ClaimResult]) -> list[str]:
    """Claims that are to remove a confound which their runs have."""
    return [
        f"{algorithm_name(one.algo)}: “{one.claim.text}” is to remove {name}, but its runs differ in it: "
        f"{confound_words(one, values=True)}."
        for one in results
        for name in one.claim.removes
        if name in one.confounds
    ]


def _quoted(names: list[str]) -> str:
    """A few names, or how many there are: each claim says it for itself."""
    if len(names) > MOST_CLAIMS:
        return f"{len(names)} claims, each of which says so below"
    return " and ".join(f"“{name}”" for name in names)


def _noise(here: list[Cell]) -> str:
    """How much of the variance between seeds the noise of their last evaluations can account for."""
    shares = []
    for env in dict.fromkeys(cell.env for cell in here):
        found = [pair for cell in select(here, env=env) if (pair := _variances(cell))]
        if found:
            noise, between = (float(np.mean(values)) for values in zip(*found))
            if between > 0:
                shares.append(f"{min(noise / between, 1):.0%} on {task_name(env)}")
    if not shares:
        return ""
    return (
        f"{algorithm_name(here[0].algo)}: of the variance between seeds, the scatter of a run's last evaluations "
        f"explains at most {', '.join(shares)}."
    )


def _variances(cell: Cell) -> tuple[float, float] | None:
    """The variance of a run's final performance through its evaluations, mean over seeds; and that between seeds."""
    late = cell.returns[:, (10 * cell.steps > 9 * cell.training_steps) & (cell.steps <= cell.training_steps)]
    if cell.n < 2 or late.shape[1] < 2:
        return None
    within = pd.DataFrame(late).var(axis=1, ddof=1).to_numpy() / late.shape[1]
    return float(np.nanmean(within)), float(cell.final.var(ddof=1))


def _diverged(here: list[Cell]) -> str:
    runs = [
        f"{actor_name(cell.arm)} on {task_name(cell.env)} {int(cell.diverged.sum())} of {cell.n}"
        for cell in here
        if cell.diverged.any()
    ]
    return (
        f"{algorithm_name(here[0].algo)}: runs diverged and count with their last value: {'; '.join(runs)}."
        if runs
        else ""
    )
