"""The verdicts on a study's claims, by the verdict rule, version 2 (``docs/report.md`` says it in full).

``judge(study, cells, claims)`` gives a :class:`Judgement`, frozen through and through::

    judgement.results              one ClaimResult per algorithm and claim; families declared, user, exploratory
      .claim                         name, text, kind, family, arms, weights, tasks
      .stage, .n, rule.planned_seeds TOO_FEW, INTERIM ("interim, 6 of 10") or FINAL, by the least n over the arms
                                     and the planned tasks
      .pooled                        Contrast in normalised points: estimate, low, high (95 %, unadjusted), p, df, error
      .covered, .missing             task names that it is over; TaskResults that it is not over, with .exclusion
      .verdict, .adjusted_p          layer 1
      .equal                         True: "no relevant difference" (with a decided verdict: "smaller than relevant")
      .every_task                    "on every task": a Verdict, None before the plan is done
      .seeds_needed                  seeds per arm that the smallest relevant effect needs
      .diverged                      verdicts with a random score for diverged runs, and without them
      .tasks                         one TaskResult per task of the claim (layer 2)
        .contrast, .normalised         in returns; in normalised points (NaN estimate: not part of the pooled effect)
        .verdict, .adjusted_p          None, NaN where no verdict is due: print estimate and interval alone
        .arms                          ArmSummary: n, beyond_plan, diverged, below_half, bimodal
        .improvement, .effect          P(improvement) with interval; Hedges' g
        .scale                         zero, hundred, own (True: 100 is the study's own AAN)
    judgement.over_algorithms      the same claims under all algorithms of the study; empty for one algorithm
    judgement.too_few_seeds        say "too few seeds to judge" once, and print no verdicts

``wording`` has the sentences: a verdict, what is missing and why, bimodal and diverged runs, the first screen's.
"""

from analysis.verdicts.judging import judge
from analysis.verdicts.results import (
    AlgorithmsResult,
    ArmSummary,
    ClaimResult,
    Exclusion,
    Improvement,
    Judgement,
    Reason,
    Stage,
    TaskResult,
    Verdict,
    WithoutDivergence,
)

__all__ = [
    "AlgorithmsResult",
    "ArmSummary",
    "ClaimResult",
    "Exclusion",
    "Improvement",
    "Judgement",
    "Reason",
    "Stage",
    "TaskResult",
    "Verdict",
    "WithoutDivergence",
    "judge",
]
