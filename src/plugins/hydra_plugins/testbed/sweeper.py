"""``hydra/sweeper=grid``: compose and validate the whole grid, print the plan, launch what is needed, close the sweep.

It stands in for Hydra's basic sweeper under every launcher: cells that are complete never reach the launcher, and what
became of the others is read from their manifests, not from what a launcher returns.
"""

from __future__ import annotations

import itertools
import re
import sys
from collections.abc import Sequence

from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import Override
from hydra.core.plugins import Plugins
from hydra.plugins.sweeper import Sweeper
from hydra.types import HydraContext, TaskFunction
from hydra_plugins.testbed.cell_launcher import CellLauncher
from omegaconf import DictConfig
from rich.console import Console

from src.config import ConfigurationError, ExperimentConfig
from src.experiment.closing import close, ending
from src.experiment.compose import cell_of
from src.experiment.decision import Action
from src.experiment.plan import Plan, check_writable, make_plan, show


class GridSweeper(Sweeper):
    """A cartesian product; the first override varies slowest, those of a sweep file come before the command line's."""

    def __init__(self, params: dict[str, str] | None, max_batch_size: int | None) -> None:
        self.params = params or {}
        self.max_batch_size = max_batch_size

    def setup(self, *, hydra_context: HydraContext, task_function: TaskFunction, config: DictConfig) -> None:
        """Hydra's own call."""
        self._config = config
        self._loader = hydra_context.config_loader
        self._launcher = Plugins.instance().instantiate_launcher(
            hydra_context=hydra_context, task_function=task_function, config=config
        )

    def sweep(self, arguments: list[str]) -> None:
        """Plan and run the grid.

        Raises:
            ConfigurationError: a cell is invalid; nothing was started.
            SystemExit: the exit code, where it isn't 0.
        """
        parser = OverridesParser.create(config_loader=self._loader)
        jobs = product(parser.parse_overrides([f"{key}={value}" for key, value in self.params.items()] + arguments))
        configs = self._compose(jobs)
        plan = make_plan(configs)
        dry = any(config.dry_run for config in configs)
        console = Console()
        ours = self._launcher if isinstance(self._launcher, CellLauncher) else None
        at_once = len(plan.to_do)
        if ours:
            at_once = min(at_once, ours.jobs_at_once(max(c.threads for c in configs)))
        show(plan, console, max(at_once, 1), with_cost=dry)
        if dry:
            return
        check_writable(configs[0])
        if ours:
            endings = ours.run_cells(plan.to_do)
        else:
            self._launch_elsewhere(plan, jobs)
            endings = [ending(cell) for cell in plan.to_do]
        code = close(endings, len(plan.having(Action.BUSY)), console)
        if code:
            sys.exit(code)

    def _compose(self, jobs: Sequence[Sequence[str]]) -> list[ExperimentConfig]:
        """Every cell; the seeds of one cell share Hydra's composition, which takes a fifth of a second."""
        shared: dict[tuple[str, ...], DictConfig] = {}
        configs = []
        mistakes: dict[str, str] = {}  # each mistake once, with the first cell that has it
        for job in jobs:
            seeds = [each for each in job if re.fullmatch(r"seed=\d+", each)]
            key = tuple(each for each in job if each not in seeds)
            if key not in shared:
                shared[key] = self._loader.load_sweep_config(self._config, list(job))
            composed = shared[key]
            if seeds:
                composed.seed = int(seeds[-1].removeprefix("seed="))
            try:
                configs.append(cell_of(composed))
            except ConfigurationError as error:
                mistakes.setdefault(str(error), " ".join(job))
        if mistakes:
            raise ConfigurationError("\n".join(f"{mistake} (in the cell {cell})" for mistake, cell in mistakes.items()))
        return configs

    def _launch_elsewhere(self, plan: Plan, jobs: Sequence[Sequence[str]]) -> None:
        """Hand the cells to do to another launcher of Hydra's; an error of one batch doesn't end the sweep."""
        needed = [list(job) for job, cell in zip(jobs, plan.cells) if cell in plan.to_do]
        size = self.max_batch_size or max(len(needed), 1)
        for start in range(0, len(needed), size):
            try:
                self._launcher.launch(needed[start : start + size], initial_job_idx=start)
            except Exception as error:
                print(f"the launcher says: {type(error).__name__}: {error}", file=sys.stderr)


def product(overrides: Sequence[Override]) -> list[list[str]]:
    """All combinations as lists of ``key=value``.

    Raises:
        ConfigurationError: a sweep over sweep files (Hydra would run two default jobs in silence) or over an interval.
    """
    choices: dict[str, list[str]] = {}
    for override in overrides:
        key = override.get_key_element()
        if not override.is_sweep_override():
            choices[key] = [f"{key}={override.get_value_element_as_str()}"]
        elif key.lstrip("+") == "sweeps":
            raise ConfigurationError("sweeps: one sweep file per command.")
        elif override.is_discrete_sweep():
            choices[key] = [f"{key}={value}" for value in override.sweep_string_iterator()]
        else:
            raise ConfigurationError(
                f"{override.input_line}: a grid needs single values, such as {key}=0,1,2 or {key}=range(3)."
            )
    return [list(job) for job in itertools.product(*choices.values())]
