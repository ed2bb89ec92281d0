"""``hydra/launcher=local`` and ``slurm``: Hydra's side of :mod:`src.experiment.launch`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from hydra.core.utils import JobReturn, JobStatus
from hydra.plugins.launcher import Launcher
from hydra.types import HydraContext, TaskFunction
from omegaconf import DictConfig, OmegaConf
from pydantic import ValidationError
from rich.console import Console

from src.config.compose import compose_run
from src.config.identity import Run
from src.config.schema import ConfigurationError
from src.config.validation import sentence
from src.experiment.display import announced
from src.experiment.launch.local import LocalSettings, run_locally
from src.experiment.launch.slurm import SlurmSettings, run_in_slurm
from src.experiment.run_directory import RunState
from src.experiment.state import RunResult


class RunLauncher(Launcher):
    """A launcher that takes runs, not command lines; ``run`` trains them, as ``settings_type`` says."""

    settings_type: type[LocalSettings] | type[SlurmSettings]
    run: Callable[..., list[RunResult]]
    trains_here: bool  # jobs have this machine's GPUs
    hint = ""  # for a key that there isn't

    def __init__(self, **keys: Any) -> None:
        self._keys = OmegaConf.to_container(OmegaConf.create(keys), resolve=True)

    def setup(self, *, hydra_context: HydraContext, task_function: TaskFunction, config: DictConfig) -> None:
        """Hydra's own call.

        Raises:
            ConfigurationError: a key of hydra.launcher can't be right.
        """
        self._config = config
        self._loader = hydra_context.config_loader
        try:
            self.settings = self.settings_type.model_validate(self._keys)
        except ValidationError as error:
            raise ConfigurationError("\n".join(map(self._sentence, error.errors()))) from None

    def _sentence(self, error: Any) -> str:
        if error["type"] == "value_error":
            return str(error["ctx"]["error"])
        if error["type"] == "extra_forbidden":
            return f"hydra.launcher.{error['loc'][0]}: there is no such key{self.hint}."
        return sentence(error, "hydra.launcher.")

    def train(self, runs: Sequence[Run]) -> list[RunResult]:
        """Train runs and return how each ended."""
        return self.run(self.settings, runs)

    def launch(self, job_overrides: Sequence[Sequence[str]], initial_job_idx: int) -> Sequence[JobReturn]:
        """Hydra's own call, for other sweepers than ours."""
        runs = [compose_run(self._loader.load_sweep_config(self._config, list(each))) for each in job_overrides]
        plan = announced(runs, Console(), 1, self.trains_here)
        results = {each.run.name: each for each in self.train([each.run for each in plan.to_do])} if plan else {}
        returns = []
        for overrides, run in zip(job_overrides, runs):
            result = results.get(run.name)
            answer = JobReturn(overrides=overrides, status=JobStatus.COMPLETED)
            answer.return_value = "complete" if plan else "planned"
            if result is not None and result.state != RunState.COMPLETE:
                answer.status = JobStatus.FAILED
                answer.return_value = RuntimeError(f"{run.name}: {result.state} {result.why}")
            returns.append(answer)
        return returns


class LocalLauncher(RunLauncher):
    """See conf/hydra/launcher/local.yaml for the arguments."""

    settings_type = LocalSettings
    run = staticmethod(run_locally)
    trains_here = True


class SlurmLauncher(RunLauncher):
    """See conf/hydra/launcher/slurm.yaml for the arguments."""

    settings_type = SlurmSettings
    run = staticmethod(run_in_slurm)
    trains_here = False
    hint = "; more of sbatch's options go into hydra.launcher.additional_parameters"
