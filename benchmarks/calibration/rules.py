"""The verdict rule on many studies at once, written anew with NumPy; the tests hold it against ``analysis.verdicts``.

A batch of studies is ``runs [studies, actors, tasks, seeds]`` in normalised points. Answers are +1 (supported), -1
(contradicted), 0 (undecided).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy.special
from numpy.typing import NDArray

Array = NDArray[np.float64]
Answers = NDArray[np.int64]
#: Actors: bptsan, popsan, aan, bptsan_wo_ndt, bptsan_wo_li; the paper's five claims as weights ``[claims, actors]``.
CLAIMS: Array = np.array(
    [[1, -1, 0, 0, 0], [1, 0, -1, 0, 0], [1, 0, 0, -1, 0], [1, 0, 0, 0, -1], [1, 1, 0, -1, -1]], dtype=float
)


@dataclass(frozen=True)
class Rule:
    """The numbers of ``claims.yaml``."""

    alpha: float = 0.05
    interim_alpha: float = 0.001
    planned_seeds: int = 10
    smallest_effect: float = 15.0


class Contrasts(NamedTuple):
    """Estimates, standard errors and degrees of freedom of one shape."""

    estimate: Array
    error: Array
    df: Array

    def greater(self) -> Array:
        """One-sided p of "not above 0"."""
        return upper_tail(self.estimate / self.error, self.df)

    def two_sided(self) -> Array:
        """Two-sided p."""
        return 2 * upper_tail(np.abs(self.estimate) / self.error, self.df)

    def covers(self, truth: float | Array, confidence: float = 0.95) -> NDArray[np.bool_]:
        """Whether the interval contains the truth."""
        half = self.error * scipy.special.stdtrit(self.df, (1 + confidence) / 2)
        return np.asarray(np.abs(self.estimate - truth) <= half)


def upper_tail(t: Array, df: Array) -> Array:
    """P(T > t) of Student's law."""
    return np.asarray(scipy.special.stdtr(df, -t))


class Study(NamedTuple):
    """Contrasts of each claim by task ``[studies, claims, tasks]``, and pooled over tasks ``[studies, claims]``."""

    tasks: Contrasts
    pooled: Contrasts


class Judged(NamedTuple):
    """``claims``, ``every_task``, ``equal``: ``[studies, claims]``; ``tasks [studies, claims, tasks]``."""

    claims: Answers
    tasks: Answers
    every_task: Answers
    equal: NDArray[np.bool_]

    def answered(self) -> NDArray[np.bool_]:
        """Studies with any answer in layers 1 and 2, ``[studies]``."""
        return np.asarray((self.claims != 0).any(axis=1) | (self.tasks != 0).any(axis=(1, 2)))


def contrasts(runs: Array, claims: Array = CLAIMS) -> Study:
    """Every contrast of a batch."""
    n, tasks = runs.shape[3], runs.shape[2]
    means, variances = runs.mean(axis=3), runs.var(axis=3, ddof=1)
    estimate = np.einsum("ca,sat->sct", claims, means)
    parts = np.einsum("ca,sat->scat", claims**2, variances) / n  # by arm
    squares = (parts**2).sum(axis=2) / (n - 1)
    variance = parts.sum(axis=2)
    rows = Contrasts(estimate, np.sqrt(variance), variance**2 / squares)
    pooled_variance = variance.sum(axis=2)
    pooled = Contrasts(
        estimate.mean(axis=2), np.sqrt(pooled_variance) / tasks, pooled_variance**2 / squares.sum(axis=2)
    )
    return Study(rows, pooled)


def holm(p: Array) -> Array:
    """Holm-adjusted p along the last axis."""
    order = np.argsort(p, axis=-1)
    count = p.shape[-1]
    stepped = np.take_along_axis(p, order, axis=-1) * np.arange(count, 0, -1)
    adjusted = np.minimum(np.maximum.accumulate(stepped, axis=-1), 1.0)
    back = np.empty_like(adjusted)
    np.put_along_axis(back, order, adjusted, axis=-1)
    return back


def judge(runs: Array, rule: Rule = Rule(), claims: Array = CLAIMS) -> Judged:
    """Version 2 of the verdict rule."""
    study = contrasts(runs, claims)
    final = runs.shape[3] >= rule.planned_seeds
    p = holm(study.pooled.two_sided())
    answers = _answers(p, study.pooled.estimate, rule.alpha if final else rule.interim_alpha)
    nothing = np.zeros(study.tasks.estimate.shape, dtype=np.int64)
    if not final:
        return Judged(answers, nothing, np.zeros_like(answers), np.zeros(answers.shape, dtype=bool))
    rows = _layer_two(study.tasks, answers != 0, rule.alpha)
    weakest = holm(np.minimum(1.0, 2 * study.tasks.greater().max(axis=2)))
    every = np.where((answers == 1) & (weakest < rule.alpha), 1, 0)
    every = np.where((rows == -1).any(axis=2), -1, every)
    return Judged(answers, rows, every, holm(equality_p(runs, rule.smallest_effect, claims)) < rule.alpha)


def equality_p(runs: Array, margin: float, claims: Array = CLAIMS, unseen_failures: float = 1.0) -> Array:
    """Of a pooled effect outside ± ``margin``, ``[studies, claims]``, counting failures that were not seen."""
    tasks, n = runs.shape[2], runs.shape[3]
    share = unseen_failures / tasks
    means, variances, low = runs.mean(axis=3), runs.var(axis=3, ddof=1), np.minimum(0.0, runs.min(axis=3))
    squares = (n - 1) * variances + n * share / (n + share) * (means - low) ** 2
    failed_means, failed_variances = (n * means + share * low) / (n + share), squares / (n + share - 1)
    p_values = []
    for sign in (1.0, -1.0):
        failing = sign * claims < 0
        estimate = np.einsum("ca,sat->sc", claims * failing, failed_means)
        estimate = (estimate + np.einsum("ca,sat->sc", claims * ~failing, means)) / tasks
        failed = np.einsum("ca,sat->scat", claims**2 * failing, failed_variances) / (n + share)
        worked = np.einsum("ca,sat->scat", claims**2 * ~failing, variances) / n
        variance = (failed + worked).sum(axis=(2, 3))
        df = variance**2 / (failed**2 / (n + share - 1) + worked**2 / (n - 1)).sum(axis=(2, 3))
        p_values.append(upper_tail((margin - sign * estimate) / (np.sqrt(variance) / tasks), df))
    return np.asarray(np.maximum(*p_values))


def _answers(adjusted_p: Array, estimate: Array, alpha: float) -> Answers:
    return np.where(adjusted_p < alpha, np.sign(estimate), 0.0).astype(np.int64)


def _layer_two(tasks: Contrasts, opened: NDArray[np.bool_], alpha: float) -> Answers:
    """Holm over the rows of each study's decided claims: others have p = infinity, which takes the last ranks."""
    studies = len(opened)
    p = np.where(opened[:, :, None], tasks.two_sided(), np.inf).reshape(studies, -1)
    order = np.argsort(p, axis=1)
    count = np.isfinite(p).sum(axis=1, keepdims=True)
    factor = np.maximum(count - np.arange(p.shape[1]), 1)
    adjusted = np.maximum.accumulate(np.take_along_axis(p, order, axis=1) * factor, axis=1)
    back = np.empty_like(adjusted)
    np.put_along_axis(back, order, adjusted, axis=1)
    return _answers(back.reshape(tasks.estimate.shape), tasks.estimate, alpha)


def judge_by_version_one(runs: Array, alpha: float = 0.05, claims: Array = CLAIMS) -> Judged:
    """Welch on every row, Holm over all rows, from 3 seeds on; "on every task" needs every row."""
    study = contrasts(runs, claims)
    p = holm(study.tasks.two_sided().reshape(len(runs), -1)).reshape(study.tasks.estimate.shape)
    rows = _answers(p, study.tasks.estimate, alpha)
    every = np.where((rows == -1).any(axis=2), -1, (rows == 1).all(axis=2))
    none = np.zeros(every.shape, dtype=np.int64)
    return Judged(none, rows, every.astype(np.int64), none.astype(bool))
