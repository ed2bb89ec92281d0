"""The calibration as Markdown tables."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from benchmarks.calibration import studies
from benchmarks.calibration.laws import LAWS, Law
from benchmarks.calibration.studies import Scenario, rates

Coverage = dict[str, dict[int, list[float]]]
Run = Callable[[str, Scenario], dict[str, float]]
SEEDS = (5, 6, 10)
_VERSION_ONE = ("version 1: n = 3", "5", "10", "looks 3 to 10")


def verdict_tables(simulations: int, seed: int) -> Iterator[str]:
    """Each table as soon as it is simulated."""

    def run(name: str, scenario: Scenario) -> dict[str, float]:
        return rates(name, scenario, simulations, seed)

    error = 2 * (0.05 * 0.95 / simulations) ** 0.5
    yield f"\nShares of {simulations:,} simulated studies a row; 0.05 is known to ± {error:.3f}.\n"
    yield _no_effect(run)
    yield _some_effect(run)
    yield _equal(run)
    yield _power(run)
    yield _failures(run)


def _no_effect(run: Run) -> str:
    rows = []
    for law in LAWS:
        by_n = {n: run(f"null {law.name} {n}", studies.no_effect(law, n)) for n in SEEDS}
        three = run(f"null {law.name} 3", studies.no_effect_by_version_one(law, 3))
        looked = run(f"looks {law.name}", studies.looks(law))
        both = run(f"both {law.name}", studies.two_algorithms(law, 10))
        rows.append(
            [
                law.name,
                *(by_n[n]["answers"] for n in SEEDS),
                max(by_n[n]["every task"] for n in SEEDS),
                looked["answers"],
                both["answers"],
                three["version 1"],
                by_n[5]["version 1"],
                by_n[10]["version 1"],
                looked["version 1"],
            ]
        )
    return _table(
        "**All actors equal: studies with a wrong answer.** To claims or on tasks (layers 1 and 2 together); “on "
        "every task”, the most over n; looked at after each seed from 5 to 10; the answers for two algorithms "
        "together; and version 1 of the rule.",
        ["returns", "n = 5", "6", "10", "every task", "looks", "two algorithms", *_VERSION_ONE],
        rows,
    )


def _some_effect(run: Run) -> str:
    rows = []
    for law in LAWS:
        one = {n: run(f"one {law.name} {n}", studies.some_tasks_differ(law, n, 1)) for n in SEEDS}
        three = {n: run(f"three {law.name} {n}", studies.some_tasks_differ(law, n, 3, 5.0)) for n in SEEDS}
        rows.append(
            [
                law.name,
                *(one[n]["other tasks"] for n in SEEDS),
                *(three[n]["other tasks"] for n in SEEDS),
                max(one[n]["every task"] for n in SEEDS),
                max(three[n]["every task"] for n in SEEDS),
            ]
        )
    return _table(
        "**A true difference on one task (3 standard deviations), or on three of four (5): wrong answers.** On the "
        "other tasks, and “on every task”, the most over n.",
        ["returns", "one: n = 5", "6", "10", "three: n = 5", "6", "10", "one: every task", "three: every task"],
        rows,
    )


def _equal(run: Run) -> str:
    rows = []
    for tasks in (4, 2, 1):
        for n in SEEDS:
            shifted = [
                run(f"shift {law.name} {n} {tasks} {s}", studies.relevant_by_a_shift(law, n, tasks, s))["equal"]
                for law in LAWS
                for s in (5.0, 15.0, 30.0)
            ]
            failing = [
                run(f"fail {n} {tasks} {s} {side}", studies.relevant_by_failures(n, tasks, s, side))["equal"]
                for s in (3.0, 8.0, 15.0)
                for side in (True, False)
            ]
            seen = [
                run(f"equal {n} {tasks} {s}", studies.equality_seen(n, tasks, s))["equal"]
                for s in (5.0, 10.0, 15.0, 20.0)
            ]
            rows.append([f"{tasks}, n = {n}", max(shifted), max(failing), *seen])
    return _table(
        "**“No relevant difference”.** Wrong, where the difference is exactly the smallest relevant one: by a shift "
        "(the most over the four laws and 5 to 30 points between seeds), by failures of 15 % of the runs of either "
        "side (the most over 3 to 15 points). Seen, where normal actors are equal at 100 points, by points between "
        "seeds, of one difference among five claims.",
        ["tasks", "wrong: shift", "wrong: failures", "seen: 5 points", "10", "15", "20"],
        rows,
    )


def _power(run: Run) -> str:
    rows = []
    for law in LAWS:
        for n in (5, 10):
            found = [run(f"power {law.name} {n} {e}", studies.power(law, n, e)) for e in (1.0, 1.5, 2.0)]
            columns = ("answer", "task", "version 1, task", "every task", "version 1, every task")
            rows.append([f"{law.name}, n = {n}", *("/".join(f"{one[c]:.2f}" for one in found) for c in columns)])
    return _table(
        "**Power at 1 / 1.5 / 2 standard deviations on every task.** The answer to a claim (version 1 had none), "
        "its verdict on one task, and “on every task”, beside version 1's.",
        ["returns", "answer", "task", "version 1", "every task", "version 1"],
        rows,
    )


def _failures(run: Run) -> str:
    rows = []
    for tasks in (4, 1):
        for n in (5, 10):
            one = run(f"steady {n} {tasks}", studies.failures_against_steady(n, tasks))
            columns = ("answer", "tasks", "every task", "version 1", "covered", "covered, task")
            rows.append([f"{tasks}, n = {n}", *(one[column] for column in columns)])
    return _table(
        "**Equal means, unequal shapes: an actor that fails in 10 % of its runs against steady ones.** Studies with "
        "a wrong answer; “on every task” where it is truly better on all tasks but one. A test of means does not "
        "hold its level here, so the page names arms of two groups beside their rows. Then how often the 95 % "
        "intervals cover the truth.",
        ["tasks", "answer", "on a task", "every task", "version 1", "covered", "covered, one task"],
        rows,
    )


def coverage_table(covered: Coverage, laws: Sequence[Law], simulations: int, resamplings: int) -> str:
    """Least and most over the laws."""
    rows = [[name, *(_range(shares) for shares in by_n.values())] for name, by_n in covered.items()]
    numbers, names = list(next(iter(covered.values()))), ", ".join(law.name for law in laws)
    return _table(
        f"**How often the shown 95 % intervals cover the truth**, least and most over {names}: {simulations:,} studies "
        f"for Welch's intervals, {resamplings:,} for Student's and the bootstrap's.",
        ["interval", *(f"n = {n}" for n in numbers)],
        rows,
    )


def coverage_file(covered: Coverage) -> str:
    """``interval_coverage.yaml``: percent by interval and number of seeds, least and most over the laws."""
    lines = [
        "# How often the shown 95% intervals cover the truth, in percent: least and most over four laws of returns, by",
        "# number of seeds. Written by `python -m benchmarks.calibration --write`; captions quote it.",
    ]
    for name, by_n in covered.items():
        shown = ", ".join(f"{n}: [{min(s) * 100:.0f}, {max(s) * 100:.0f}]" for n, s in by_n.items())
        lines.append(f"{name}: {{{shown}}}")
    return "\n".join(lines) + "\n"


def _range(shares: Sequence[float]) -> str:
    return f"{min(shares):.3f} to {max(shares):.3f}"


def _table(title: str, headers: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    lines = [title, "", "| " + " | ".join(headers) + " |", "|" + "---|" * len(headers)]
    for row in rows:
        lines.append("| " + " | ".join(f"{v:.3f}" if isinstance(v, float) else str(v) for v in row) + " |")
    return "\n" + "\n".join(lines) + "\n"
