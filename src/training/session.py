"""The training loop, and what a checkpoint holds of it (docs/faults.md).

collect 50 steps -> store -> normaliser -> 50 updates -> evaluate, log, checkpoint where due.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import torch
from torch import Tensor

from src.algorithms.build import build_learner
from src.algorithms.learner import Batch
from src.algorithms.metrics import METRICS, Diverged, IntervalMeans, health_columns
from src.config.schema import ConfigurationError, ExperimentConfig
from src.experiment.progress import Progress
from src.experiment.run_directory import (
    BEST_POLICY_FILE,
    POLICY_FILE,
    REPLAY_FILE,
    ROBUSTNESS_FILE,
    RunDirectory,
    RunState,
)
from src.experiment.state import Outcome
from src.policies.operations import count_operations, write_operations
from src.streams import Streams
from src.training.checkpoint import check_logs, newest_checkpoint, save_checkpoint
from src.training.collection import make_collector, transitions
from src.training.environment import TrainingEnvironment
from src.training.evaluation import Evaluator
from src.training.loggers import Logger, open_logger
from src.training.normalization import Normalizer
from src.training.numerics import record_blas, select_blas, set_numerics
from src.training.policy_file import PolicyRecord, save_policy
from src.training.replay import Replay, TransitionLog, sample_minibatches


def train(
    config: ExperimentConfig, run: RunDirectory, progress: Progress, stop_requested: Callable[[], bool]
) -> Outcome:
    """Train one run of the grid to ``protocol.total_steps``, from its checkpoint where there is one.

    Args:
        config: the validated configuration.
        run: its run directory, which this process owns.
        progress: where a person watches.
        stop_requested: asked at every batch boundary; once true, the run writes a checkpoint and ends.

    Returns:
        How it ended. ``complete`` leaves ``policy.pt`` and ``operations.json``.
    """
    set_numerics(config.threads)
    if config.device.startswith("cuda") and not torch.cuda.is_available():
        raise ConfigurationError(f"device: {config.device} is asked for and PyTorch finds no CUDA GPU; use cpu.")
    if config.backend != "plain":
        select_blas(config, run)
    session = TrainingSession(config, run, progress)
    record_blas(run, progress, session.learner.backend)
    return session.loop(stop_requested)


class TrainingSession:
    """One run in progress: its parts, where it stands, and how both are saved and restored."""

    def __init__(self, config: ExperimentConfig, run: RunDirectory, progress: Progress) -> None:
        self.config, self.run, self.progress = config, run, progress
        self.streams = Streams(config.seed)
        self.environment = TrainingEnvironment(config.env, seed=self.streams.integer("environment"))
        self.sizes = (self.environment.observation_size, self.environment.action_size)
        self.action_limit = self.environment.action_limit
        self.learner = build_learner(config, *self.sizes, self.action_limit, self.streams)
        if run.manifest.backend not in (None, self.learner.backend):
            raise ConfigurationError(
                f"backend: this run was trained on {run.manifest.backend} and would go on with {self.learner.backend}, "
                f"whose checkpoints are other ones; use backend={run.manifest.backend}, or on_conflict=replace."
            )
        self.normalizer = Normalizer(self.sizes[0], config.normalization_clip, config.normalize_observations)
        self.random_actions = self.streams.torch("random actions")
        log = TransitionLog(run.state / REPLAY_FILE, config.protocol.total_steps, *self.sizes)
        self.replay = Replay(log, config.algo.replay_capacity, self.streams.torch("replay"))
        self.evaluator = Evaluator(config.env, config.protocol.evaluation_episodes, self.streams)
        self.interval = IntervalMeans()
        self.interval_seconds = 0.0
        self.rate = 0.0  # environment steps per second, for display
        self.step = 0
        self.last_return: float | None = None
        self.best: PolicyRecord | None = None  # the highest evaluation so far; of equal ones the first
        run.update_manifest(
            backend=self.learner.backend,
            observation_size=self.sizes[0],
            action_size=self.sizes[1],
            parameters={
                "actor": self.learner.policy.actor.connection_count(),
                "critic": sum(p.numel() for p in self.learner.modules["critic"].parameters()),
            },
        )

    # ------------------------------------------------------------------ the loop

    def loop(self, stop_requested: Callable[[], bool]) -> Outcome:
        """Run to the end, to a stop request, or to non-finite numbers."""
        p = self.config.protocol
        self.resume()
        logger = open_logger(self.config, self.run, self.step)
        collector = make_collector(self.environment, self._act_in_training, p.update_every)
        try:
            if self.step == 0:
                self._evaluate(logger)
            batches = iter(collector)
            while self.step < p.total_steps:
                started = time.perf_counter()
                batch = next(batches)
                self._advance(batch)
                self.interval_seconds += time.perf_counter() - started
                if self.step % p.evaluation_interval == 0:
                    self._evaluate(logger)
                stop = stop_requested()
                if stop or self.step % p.checkpoint_interval == 0 or self.step == p.total_steps:
                    self.save()
                self.progress.update(self.step, self.last_return, self._steps_per_second())
                if stop and self.step < p.total_steps:
                    return Outcome(RunState.INTERRUPTED, self.step, f"checkpoint written at step {self.step}")
        except Diverged as error:
            return Outcome(RunState.DIVERGED, self.step, f"{error} at step {self.step}")
        finally:
            logger.close()
            collector.shutdown()
        assert self.last_return is not None  # step 0 was evaluated
        self._save_policy(POLICY_FILE, PolicyRecord(self.step, self.last_return))
        (self.run.path / ROBUSTNESS_FILE).unlink(missing_ok=True)  # of the policy that an extended run had before
        self._count_operations()
        return Outcome(RunState.COMPLETE, self.step, "")

    def _act_in_training(self, observation: Tensor) -> Tensor:
        """Action ``[M]`` for the raw observation ``[N]``: uniform at first, then exploring."""
        if self.step < self.config.protocol.start_steps:
            return (2.0 * torch.rand(self.sizes[1], generator=self.random_actions) - 1.0) * self.action_limit
        normalized = self.normalizer.normalize(observation).unsqueeze(0).to(self.config.device)
        return self.learner.explore(normalized)[0].cpu()

    def _act_in_evaluation(self, observation: Tensor, generator: torch.Generator) -> Tensor:
        """Actions ``[k, M]`` for raw observations ``[k, N]``."""
        normalized = self.normalizer.normalize(observation).to(self.config.device)
        return self.learner.act(normalized, generator).cpu()

    def _advance(self, batch: Any) -> None:
        """Store one collector batch, then one burst of updates."""
        p, device = self.config.protocol, self.config.device
        collected = transitions(batch)
        self.replay.extend(collected)
        self.normalizer.update(collected.observation)
        self.step += p.update_every
        for episode_return, _ in collected.finished:
            self.interval.add({"training_return": episode_return})
        if self.step <= p.update_after:
            return
        count = p.update_every * self.learner.minibatches_per_update
        sample = sample_minibatches(self.replay, count, self.config.algo.batch_size)
        burst = Batch(
            observation=self.normalizer.normalize(sample.observation).to(device),
            action=sample.action.to(device),
            reward=sample.reward.to(device),
            next_observation=self.normalizer.normalize(sample.next_observation).to(device),
            terminated=sample.terminated.to(device),
        )
        self.interval.add(self.learner.learn(burst))

    def _evaluate(self, logger: Logger) -> None:
        """Evaluate the deterministic policy, write both logs, begin a new interval."""
        started = time.perf_counter()
        self.learner.check_finite()
        episodes = self.evaluator.evaluate(self._act_in_evaluation, self.step)
        self.run.evaluations.append(self.step, episodes)
        self.last_return = sum(r for r, _ in episodes) / len(episodes)
        if self.best is None or self.last_return > self.best.mean_return:
            self.best = PolicyRecord(self.step, self.last_return)
            if self.config.keep_best:
                self._save_policy(BEST_POLICY_FILE, self.best)
        self.interval_seconds += time.perf_counter() - started
        if self.step > 0:
            row = self._training_row()
            self.run.training.write(row)
            logger.write(self.step, row | {"evaluation_return": self.last_return})
        else:
            logger.write(0, {"evaluation_return": self.last_return})
        self.interval = IntervalMeans()
        self.interval_seconds = 0.0

    def _save_policy(self, name: str, record: PolicyRecord) -> None:
        save_policy(self.run.path / name, self.config, self.learner, self.normalizer, self.sizes, record)

    def _count_operations(self) -> None:
        """Count the final policy's operations over the episodes of the last evaluation; no run fails of it."""
        try:
            counted = count_operations(
                self.learner.policy, self.normalizer, self.evaluator, self.step, self.config.device
            )
            write_operations(self.run.path, counted)
        except Exception as error:
            note = f"operations were not counted: {error}"
            self.progress.note(note)
            self.run.update_manifest(notes=[*self.run.manifest.notes, note])

    def _steps_per_second(self) -> float:
        """Since the last evaluation; right after one, the rate of the interval before it."""
        steps = self.step % self.config.protocol.evaluation_interval or self.config.protocol.evaluation_interval
        if self.interval_seconds > 0:
            self.rate = steps / self.interval_seconds
        return self.rate

    def _training_row(self) -> dict[str, float | None]:
        """One row of ``training.csv`` (docs/run-directory.md)."""
        row: dict[str, float | None] = {
            "step": self.step,
            "critic_updates": self.learner.critic_updates,
            "actor_updates": self.learner.actor_updates,
        }
        proxy = ("proxy_loss",) if "proxy" in self.learner.modules else ()
        for name in (*METRICS, *proxy, "training_return"):
            row[name] = self.interval.mean(name)
        row["steps_per_second"] = self._steps_per_second()
        for name in health_columns(len(self.learner.policy.actor.layer_parameters())):
            row[name] = self.interval.mean(name)
        return row

    # ------------------------------------------------------------------ saved and restored

    def _generators(self) -> dict[str, torch.Generator]:
        return {
            "random_actions": self.random_actions,
            "replay": self.replay.generator,
            **self.learner.streams._asdict(),
        }

    def save(self) -> None:
        """Write a checkpoint: everything that the rest of the run depends on."""
        self.replay.log.flush()
        save_checkpoint(self.run.state, self.step, self.state_dict())
        self.run.update_manifest(step=self.step, checkpoint_step=self.step)

    def resume(self) -> None:
        """Go on from the newest whole checkpoint; without one, from the beginning.

        Raises:
            CorruptState: none of the run's checkpoints is left whole.
            CorruptState: the logs or the replay lack what was written before it.
        """
        content = newest_checkpoint(self.run, self.progress)
        if content is None:
            self.run.cut_after(-1)
            self.replay.log.truncate(0)
            return
        self.load_state_dict(content)
        check_logs(self.run, self.config.protocol, self.step)
        self.run.cut_after(self.step)
        self.progress.note(f"resumed at step {self.step}")

    def state_dict(self) -> dict[str, Any]:
        """What a checkpoint holds; transitions are in the replay's own file."""
        return {
            "configuration_hash": self.run.manifest.configuration_hash,
            "step": self.step,
            "learner": self.learner.state_dict(),
            "normalizer": self.normalizer.state_dict(),
            "generators": {name: g.get_state() for name, g in self._generators().items()},
            "replay_length": len(self.replay),
            "environment": self.environment.save_state(),
            "interval": self.interval.state_dict(),
            "interval_seconds": self.interval_seconds,
            "last_return": self.last_return,
            "best": None if self.best is None else list(self.best),
        }

    def load_state_dict(self, content: dict[str, Any]) -> None:
        """Restore what :meth:`state_dict` gave."""
        self.step = content["step"]
        self.learner.load_state_dict(content["learner"])
        self.normalizer.load_state_dict(content["normalizer"])
        for name, generator in self._generators().items():
            generator.set_state(content["generators"][name])
        self.replay.log.truncate(content["replay_length"])
        self.environment.restore_on_next_reset(content["environment"])
        self.interval.load_state_dict(content["interval"])
        self.interval_seconds = content["interval_seconds"]
        self.last_return = content["last_return"]
        self.best = None if content["best"] is None else PolicyRecord(*content["best"])
