"""What judging a study gives: frozen, one object for each question that a page asks."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from analysis.claims_file import Claim, Claims
from analysis.data.confounds import Confound
from analysis.hypothesis_tests import Contrast
from analysis.references import Scale


class Verdict(StrEnum):
    """The answer to a claim; the value is how it is printed."""

    SUPPORTED = "supported"
    CONTRADICTED = "contradicted"
    UNDECIDED = "undecided"  # tested, no difference detected, which is not equality
    TOO_FEW_SEEDS = "too few seeds to judge"
    NOT_TESTABLE = "not testable"  # no task can be tested; ``TaskResult.exclusion`` says why

    @property
    def decided(self) -> bool:
        """Whether it answers the claim."""
        return self in (Verdict.SUPPORTED, Verdict.CONTRADICTED)


class Stage(StrEnum):
    """Where a claim stands in its plan, by the least number of seeds in its arms and by its planned tasks."""

    TOO_FEW = "too few seeds"  # under 5: estimates only
    INTERIM = "interim"  # under the plan: layer 1 alone, at the interim alpha
    FINAL = "final"


class Reason(StrEnum):
    """Why a task is no part of a claim's pooled effect, or a test cannot be made."""

    NO_RUNS = "no runs"  # of any actor on this task
    NO_FINISHED_RUN = "no finished run"
    UNEQUAL_SETTINGS = "unequal settings"
    NO_REFERENCE_SCORE = "no reference score"  # the row can be tested, but has no normalised score
    TOO_FEW_SEEDS = "too few seeds"
    NO_VARIANCE = "no variance"


@dataclass(frozen=True)
class Exclusion:
    """``arms`` that a reason is about (all of the claim's, where it is about the task); ``details``: phrases."""

    reason: Reason
    arms: tuple[str, ...]
    details: tuple[str, ...] = ()


@dataclass(frozen=True)
class ArmSummary:
    """One arm of a claim on one task. Seeds beyond the plan are not among ``n``."""

    name: str
    n: int
    beyond_plan: int
    diverged: int
    below_half: float  # share of seeds below half of the reference score; NaN without one
    failed: int  # seeds below the failure score; 0 without a reference score
    bimodal: bool  # a gap splits its seeds: the mean misleads


@dataclass(frozen=True)
class Improvement:
    """Probability that a seed of the first arm beats one of the second, ties half; interval NaN where there is none."""

    probability: float
    low: float
    high: float


@dataclass(frozen=True)
class WithoutDivergence:
    """Verdicts with a random policy's score for diverged runs, and without these; None: as under the gate, none."""

    random_score: Verdict | None
    left_out: Verdict | None


@dataclass(frozen=True)
class TaskResult:
    """A claim on one task (layer 2).

    Attributes:
        contrast: in returns; estimate and unadjusted 95% interval are always to be shown.
        normalised: the same in normalised points (100: the AAN reference); all NaN without a reference score.
        exclusion: why the task is no part of the pooled effect, or cannot be tested; None where it is in order.
        verdict: None where no verdict is due: layer 1 did not decide the claim, or the study is interim.
        adjusted_p: Holm over the rows of the decided claims; NaN where there is no verdict.
        effect: Hedges' g; NaN for an interaction.
        improvement: None for an interaction, or without finished runs of both arms.
        diverged: None where no run diverged, or no verdict is due.
        confounds: what goes with the actors and is not the same in the arms.
    """

    env: str
    arms: tuple[ArmSummary, ...]
    scale: Scale | None
    contrast: Contrast
    normalised: Contrast
    exclusion: Exclusion | None
    verdict: Verdict | None
    adjusted_p: float
    effect: float
    improvement: Improvement | None
    diverged: WithoutDivergence | None
    confounds: tuple[Confound, ...]

    @property
    def covered(self) -> bool:
        """Whether the task is part of the pooled effect."""
        return self.normalised.estimate == self.normalised.estimate


@dataclass(frozen=True)
class ClaimResult:
    """A claim under one algorithm (layer 1), and its tasks.

    Attributes:
        pooled: the effect in normalised points over the covered tasks; all NaN where none is covered.
        n: least number of seeds over the arms of the covered tasks.
        adjusted_p: Holm over the family; NaN where there is no test.
        equal: "no relevant difference": the effect lies within the smallest relevant one, unseen failures counted; None
            before the plan is done.
        every_task: the claim "on every task"; None before the plan is done.
        every_task_p: its adjusted p; NaN where it is not testable on some task.
        seeds_needed: seeds per arm that the smallest relevant effect needs, at the pooled spread within arms and the
            family's first Holm step; None where the spread is not known.
        diverged: None where no run of the claim diverged.
    """

    algo: str
    claim: Claim
    stage: Stage
    n: int
    pooled: Contrast
    adjusted_p: float
    verdict: Verdict
    equal: bool | None
    equal_p: float
    every_task: Verdict | None
    every_task_p: float
    seeds_needed: int | None
    diverged: WithoutDivergence | None
    tasks: tuple[TaskResult, ...]

    @property
    def covered(self) -> tuple[str, ...]:
        """The tasks that the pooled effect is over."""
        return tuple(task.env for task in self.tasks if task.covered)

    @property
    def confounds(self) -> tuple[str, ...]:
        """The names of what goes with the actors and is not the same in the arms, on any task."""
        return tuple(dict.fromkeys(confound.name for task in self.tasks for confound in task.confounds))

    @property
    def missing(self) -> tuple[TaskResult, ...]:
        """The tasks that it is not over; their ``exclusion`` says why."""
        return tuple(task for task in self.tasks if not task.covered)


@dataclass(frozen=True)
class AlgorithmsResult:
    """A claim under all algorithms of a study: supported under each, or contradicted under one."""

    algos: tuple[str, ...]
    claim: Claim
    verdict: Verdict
    adjusted_p: float
    every_task: Verdict | None
    every_task_p: float
    each: tuple[ClaimResult, ...]


@dataclass(frozen=True)
class Judgement:
    """Every claim of a study. ``results``: by algorithm, then family, then in the order of the claims file."""

    rule: Claims
    results: tuple[ClaimResult, ...]
    over_algorithms: tuple[AlgorithmsResult, ...]  # empty for a study with one algorithm

    @property
    def too_few_seeds(self) -> bool:
        """Whether no claim has enough seeds, so that the page says so once and prints no verdicts."""
        return bool(self.results) and all(
            result.verdict in (Verdict.TOO_FEW_SEEDS, Verdict.NOT_TESTABLE) for result in self.results
        )
