"""``hydra/sweeper=grid``: compose and validate the whole grid, print the plan, launch what is needed, sum up.

It stands in for Hydra's basic sweeper under every launcher: runs that are complete never reach the launcher, and what
became of the others is read from their manifests, not from what a launcher returns.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Sequence

from hydra._internal.core_plugins.basic_sweeper import BasicSweeper
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra_plugins.testbed.launcher import RunLauncher
from omegaconf import DictConfig
from rich.console import Console

from src.config.command_line import check_sweep
from src.config.compose import compose_run
from src.config.identity import Run
from src.config.schema import ConfigurationError
from src.experiment.display import announced, show_summary
from src.experiment.state import Next, result_of


class GridSweeper(BasicSweeper):
    """A cartesian product; the first override varies slowest, those of a sweep file come before the command line's."""

    def sweep(self, arguments: list[str]) -> None:
        """Plan and run the grid.

        Raises:
            ConfigurationError: a run is invalid; nothing was started.
            SystemExit: the exit code, where it isn't 0.
        """
        jobs, runs = self._compose(arguments)
        run_launcher = self.launcher if isinstance(self.launcher, RunLauncher) else None
        trains_here, at_once = type(self.launcher).__name__ == "BasicLauncher", len(runs)
        if run_launcher:
            trains_here = run_launcher.trains_here
            at_once = run_launcher.settings.jobs_at_once(max(run.config.threads for run in runs))
        console = Console()
        plan = announced(runs, console, at_once, trains_here)
        if plan is None:
            return
        to_do = [each.run for each in plan.to_do]
        if run_launcher:
            results = run_launcher.train(to_do)
        else:
            self._launch_elsewhere([job for job, run in zip(jobs, runs) if run in to_do])
            results = [result_of(run) for run in to_do]
        if code := show_summary(results, len(plan.having(Next.BUSY)), console):
            sys.exit(code)

    def _compose(self, arguments: Sequence[str]) -> tuple[list[list[str]], list[Run]]:
        """Every job and its run; the seeds of one configuration share Hydra's composition (a fifth of a second).

        Two jobs that differ only in a key that changes nothing (``actor=aan encoder.population_size=10,20``) are one.
        """
        assert self.hydra_context is not None and self.config is not None
        loader = self.hydra_context.config_loader
        parser = OverridesParser.create(config_loader=loader)
        overrides = parser.parse_overrides([*self._parse_config(), *arguments])
        for each in overrides:
            check_sweep(each)
        shared: dict[tuple[str, ...], DictConfig] = {}
        kept: list[list[str]] = []
        runs: list[Run] = []
        mistakes: dict[str, str] = {}  # each mistake once, with the first run that has it
        for job in self.split_arguments(overrides, None)[0]:
            seeds = [each for each in job if re.fullmatch(r"seed=\d+", each)]
            key = tuple(each for each in job if each not in seeds)
            if key not in shared:
                shared[key] = loader.load_sweep_config(self.config, job)
            composed = shared[key]
            if seeds:
                composed.seed = int(seeds[-1].removeprefix("seed="))
            try:
                run = compose_run(composed)
            except ConfigurationError as error:
                mistakes.setdefault(str(error), " ".join(job))
                continue
            if run in runs and job not in kept:
                continue
            kept.append(job)
            runs.append(run)
        if mistakes:
            raise ConfigurationError("\n".join(f"{mistake} (in the run {run})" for mistake, run in mistakes.items()))
        return kept, runs

    def _launch_elsewhere(self, jobs: Sequence[Sequence[str]]) -> None:
        """Hand jobs to another launcher of Hydra's; an error of one batch doesn't end the sweep."""
        assert self.launcher is not None
        size = self.max_batch_size or max(len(jobs), 1)
        for start in range(0, len(jobs), size):
            try:
                self.launcher.launch(jobs[start : start + size], initial_job_idx=start)
            except Exception as error:
                print(f"the launcher says: {type(error).__name__}: {error}", file=sys.stderr)
