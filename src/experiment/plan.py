"""The plan of a grid: whether every run can be trained here and what will be done with it, before anything starts.

A mistake costs one sentence instead of a queue of failed jobs. Never imports torch in this process.
"""

from __future__ import annotations

import importlib.util
import json
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import closing
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from src.config.identity import Run, differences, flatten, hashed_values
from src.config.schema import ENGINE, ConfigurationError, EnvConfig, ExperimentConfig
from src.config.validation import to_dict
from src.experiment.ownership import conflict_message
from src.experiment.run_directory import ManifestError, RunDirectory
from src.experiment.state import TO_DO, Next, PlannedRun, next_action
from src.paths import repository_path

#: So many runs are named one by one; the rest is counted.
NAMED = 10
_LOGGERS = {
    "wandb": "logger=wandb: wandb is not installed; run: pip install '.[wandb]'",
    "tensorboard": "logger=tensorboard: tensorboard is not installed; install it, or take logger=none",
}


class Plan(NamedTuple):
    """All runs of a grid, in the order of the grid."""

    runs: tuple[PlannedRun, ...]

    @property
    def to_do(self) -> tuple[PlannedRun, ...]:
        """The runs that start a job."""
        return tuple(each for each in self.runs if each.action in TO_DO)

    def having(self, action: Next) -> tuple[PlannedRun, ...]:
        """The runs with this action."""
        return tuple(each for each in self.runs if each.action is action)


def make_plan(runs: Sequence[Run], gpus_here: bool = False) -> Plan:
    """Decide for every run of a grid; ``gpus_here``: it will train on this machine, whose GPUs can be counted.

    Raises:
        ConfigurationError: what can't be run here; two runs share a directory, or a directory holds another
            configuration's run; the seeds of one label differ in more than their seed.
    """
    configs = [run.config for run in runs]
    _check_installed(configs)
    if gpus_here:
        _check_devices(configs)
    _refuse_shared_directories(runs)
    plan = Plan(tuple(map(next_action, runs)))
    _refuse([conflict_message(each) for each in plan.having(Next.CONFLICT)])
    _refuse(list(_mixed_seeds(runs)))
    return plan


def _refuse(mistakes: Sequence[str]) -> None:
    if mistakes:
        more = [f"... and {len(mistakes) - NAMED} more runs like these."] if len(mistakes) > NAMED else []
        raise ConfigurationError("\n".join([*mistakes[:NAMED], *more]))


def _refuse_shared_directories(runs: Sequence[Run]) -> None:
    seen: dict[Path, Run] = {}
    for run in runs:
        if run.path not in seen:
            seen[run.path] = run
            continue
        other = seen[run.path]
        keys = [each.key for each in differences(flatten(to_dict(other.config)), flatten(to_dict(run.config)))]
        if not keys:
            raise ConfigurationError(f"{run.name}: the grid has this run twice; name it once.")
        raise ConfigurationError(
            f"Two runs of the grid would share the directory {run.name}: they differ in {', '.join(keys)}. "
            f"Tell them apart with label=, such as 'label={run.config.actor.name}-${{{keys[0]}}}'."
        )


def _mixed_seeds(runs: Sequence[Run]) -> Iterator[str]:
    """The seeds of one label must be one configuration, those of this grid and those that lie beside them."""
    planned = {run.path for run in runs}
    first: dict[Path, tuple[str, dict[str, Any]]] = {}
    for run in runs:
        own = compared_between_seeds(to_dict(run.config), ENGINE)
        folder = run.path.parent
        if folder in first:
            others = [first[folder]]
        else:
            first[folder] = (f"seed {run.config.seed}", own)
            others = [
                (f"{sibling.name.replace('_', ' ')}, which is there already", there)
                for sibling in sorted(folder.glob("seed_*"))
                if sibling not in planned and (there := compared_on_disk(sibling)) is not None
            ]
        for other, values in others:
            if changes := differences(values, own):
                yield (
                    f"{run.name} and {other}: they differ in more than the seed: {', '.join(map(str, changes))}. "
                    "One label is one configuration: choose another place (study=..., or label=... for a variant), "
                    "or ask for all its seeds alike."
                )


def compared_between_seeds(content: dict[str, Any], engine: int) -> dict[str, Any]:
    """What all seeds of one label have in common: all that changes numbers, and how long they train."""
    return hashed_values(content) | {
        "seed": None,
        "protocol.total_steps": content["protocol"]["total_steps"],
        "engine": engine,
    }


def compared_on_disk(path: Path) -> dict[str, Any] | None:
    """The same of a run directory; None where it holds no run that can be read."""
    directory = RunDirectory(path)
    try:
        manifest = directory.read_manifest()
    except ManifestError:
        return None
    content = directory.read_config()
    if manifest is None or content is None:
        return None
    try:
        return compared_between_seeds(content, manifest.engine) | {"protocol.total_steps": manifest.total_steps}
    except (KeyError, TypeError):
        return None


def _check_installed(configs: Sequence[ExperimentConfig]) -> None:
    """Build each distinct task once, and look for the loggers' packages."""
    tasks = {json.dumps([config.env.id, config.env.kwargs], sort_keys=True): config.env for config in configs}
    loggers = {config.logger.name for config in configs}
    mistakes = [_LOGGERS[name] for name in sorted(loggers & _LOGGERS.keys()) if importlib.util.find_spec(name) is None]
    for task in tasks.values():
        try:
            build_task(task)
        except ConfigurationError as error:
            mistakes.append(str(error))
    if mistakes:
        raise ConfigurationError("\n".join(mistakes))


def build_task(task: EnvConfig) -> None:
    """Build a task and take one step.

    Raises:
        ConfigurationError: that can't be done on this machine, or the task is none that a run can be saved on.
    """
    from src.training.gym_task import make_gym  # Gymnasium takes a while to import

    with closing(make_gym(task)) as environment:
        try:
            environment.reset(seed=0)
            environment.step(environment.action_space.sample() * 0)
        except Exception as error:
            raise ConfigurationError(
                f"env: {task.id} with the arguments {task.kwargs} fails at its first step: "
                f"{type(error).__name__}: {error}"
            ) from None


def _check_devices(configs: Sequence[ExperimentConfig]) -> None:
    """Ask PyTorch, in a process of its own, for the GPUs that runs of this machine want."""
    for device in sorted({config.device for config in configs if config.device != "cpu"}):
        wanted = int(device.partition(":")[2] or 0)
        if wanted >= gpu_count():
            found = f"{gpu_count()} CUDA GPU{'s' * (gpu_count() != 1)}" if gpu_count() else "no CUDA GPU"
            raise ConfigurationError(f"device: {device} is asked for and PyTorch finds {found}; use cpu.")


@cache
def gpu_count() -> int:
    """How many CUDA devices PyTorch finds on this machine."""
    command = [sys.executable, "-c", "import torch; print(torch.cuda.device_count() * torch.cuda.is_available())"]
    done = subprocess.run(command, capture_output=True, text=True)
    return int(done.stdout) if done.returncode == 0 else 0


def check_writable(config: ExperimentConfig) -> None:
    """Try to write where the results go.

    Raises:
        ConfigurationError: that can't be done.
    """
    folder = repository_path(config.results_dir)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise ConfigurationError(
            f"results_dir: {config.results_dir} can't be written ({error.strerror}); choose another folder."
        ) from None
