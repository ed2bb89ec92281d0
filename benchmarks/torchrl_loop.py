"""TD3 from TorchRL's own parts, put together as in its ``sota-implementations/td3``: what a user of TorchRL runs."""

from __future__ import annotations

import logging
import statistics
from pathlib import Path
from typing import Any

import torch
from tensordict.nn import TensorDictModule, TensorDictSequential
from torchrl.collectors import Collector
from torchrl.data import LazyTensorStorage, TensorDictReplayBuffer
from torchrl.envs import Compose, DoubleToFloat, EnvBase, GymWrapper, RewardSum, SerialEnv, TransformedEnv
from torchrl.envs.utils import ExplorationType, set_exploration_type
from torchrl.modules import MLP, AdditiveGaussianModule, TanhModule, ValueOperator
from torchrl.objectives import SoftUpdate, TD3Loss
from torchrl.record.loggers.csv import CSVLogger

from benchmarks.relay import Turns
from src.config.schema import EnvConfig, ExperimentConfig, TD3Config
from src.training.gym_task import make_gym


def torchrl(turns: Turns, config: ExperimentConfig, evaluation_env: EnvConfig, folder: Path) -> None:
    """A runner; times the part ``evaluation``. Bursts as ours; no normalisation of observations."""
    logging.getLogger("torchrl").setLevel(logging.WARNING)
    a, p = config.algo, config.protocol
    assert isinstance(a, TD3Config)
    torch.manual_seed(config.seed)
    environment = _transformed(GymWrapper(make_gym(config.env)))
    evaluation = _transformed(SerialEnv(p.evaluation_episodes, lambda: GymWrapper(make_gym(evaluation_env))))
    actor, exploring, critic = _networks(a, environment)
    loss = TD3Loss(
        actor_network=actor,
        qvalue_network=critic,
        num_qvalue_nets=2,
        loss_function="l2",
        delay_actor=True,
        delay_qvalue=True,
        action_spec=environment.action_spec_unbatched,
        policy_noise=a.target_noise,
        noise_clip=a.target_noise_clip,
    )
    loss.make_value_estimator(gamma=a.discount)
    targets = SoftUpdate(loss, eps=a.polyak)
    adam_actor = torch.optim.Adam(list(loss.actor_network_params.flatten_keys().values()), a.actor_learning_rate)
    adam_critic = torch.optim.Adam(list(loss.qvalue_network_params.flatten_keys().values()), a.critic_learning_rate)
    replay = TensorDictReplayBuffer(storage=LazyTensorStorage(a.replay_capacity), batch_size=a.batch_size)
    logger = CSVLogger("torchrl", str(folder))
    collector = Collector(
        environment,
        exploring,
        frames_per_batch=p.update_every,
        total_frames=p.total_steps,
        init_random_frames=p.start_steps,
        device="cpu",
        auto_register_policy_transforms=False,
    )

    def evaluate() -> float:
        with set_exploration_type(ExplorationType.DETERMINISTIC), torch.no_grad():
            rollout = evaluation.rollout(evaluation_env.max_episode_steps, actor, break_when_any_done=True)
        return float(rollout["next", "reward"].sum(-2).mean())

    evaluate_timed = turns.timed("evaluation", evaluate)
    step = 0
    batches = iter(collector)
    while turns.reached(step):
        batch = next(batches)
        collector.update_policy_weights_()
        batch = batch.reshape(-1)
        replay.extend(batch)
        step += batch.numel()
        if step > p.update_after:
            critic_losses, actor_losses = [], []
            for index in range(p.update_every):
                sample = replay.sample()
                critic_loss, *_ = loss.value_loss(sample)
                adam_critic.zero_grad()
                critic_loss.backward()
                adam_critic.step()
                critic_losses.append(critic_loss.item())
                if index % a.policy_delay == 0:
                    actor_loss, *_ = loss.actor_loss(sample)
                    adam_actor.zero_grad()
                    actor_loss.backward()
                    adam_actor.step()
                    actor_losses.append(actor_loss.item())
                    targets.step()
            logger.log_scalar("critic_loss", statistics.fmean(critic_losses), step)
            logger.log_scalar("actor_loss", statistics.fmean(actor_losses), step)
        finished = batch["next", "episode_reward"][batch["next", "done"]]
        if finished.numel():
            logger.log_scalar("training_return", float(finished.mean()), step)
        if step % p.evaluation_interval == 0:
            logger.log_scalar("evaluation_return", evaluate_timed(), step)
    collector.shutdown()


def _transformed(environment: EnvBase) -> TransformedEnv:
    return TransformedEnv(environment, Compose(DoubleToFloat(), RewardSum()))


def _networks(config: TD3Config, environment: TransformedEnv) -> tuple[Any, Any, Any]:
    """Actor, exploring actor, critic."""
    spec = environment.action_spec_unbatched
    hidden = list(config.critic_hidden_sizes)
    size = environment.observation_spec["observation"].shape[-1]
    network = MLP(size, spec.shape[-1], num_cells=hidden, activation_class=torch.nn.ReLU)
    actor = TensorDictSequential(
        TensorDictModule(network, in_keys=["observation"], out_keys=["parameter"]),
        TanhModule(in_keys=["parameter"], out_keys=["action"], spec=spec),
    )
    critic = ValueOperator(
        MLP(size + spec.shape[-1], 1, num_cells=hidden, activation_class=torch.nn.ReLU),
        in_keys=["action", "observation"],
    )
    noise = AdditiveGaussianModule(spec=spec, sigma_init=1.0, sigma_end=1.0, mean=0.0, std=config.exploration_noise)
    return actor, TensorDictSequential(actor, noise), critic
