"""One episode of a trained policy, with everything that its network did."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import gymnasium
import numpy as np
import torch

from src.policies.operations import OperationCounter, Operations, kind_of
from src.policies.trace import Neurons, NotTraceable, Trace, trace
from src.streams import Streams
from src.training.evaluation import FRESH
from src.training.policy_file import TrainedPolicy

#: Called after the reset and after every step with the number of steps and the return so far.
OnStep = Callable[[int, float], None]


@dataclass
class Population:
    """A layer over the episode; ``spiking`` ones hold spikes, others real activations.

    ``first`` is every time step of the first decisions, ``[decisions * S, n]``; ``rates`` the mean over the time steps
    of each decision, ``[steps, n]``.
    """

    name: str
    spiking: bool
    time_steps: int
    first: np.ndarray
    rates: np.ndarray


@dataclass
class Episode:
    """What happened. ``populations`` is empty and ``operations`` None for an actor that can't be looked into."""

    actions: np.ndarray  # [steps, M]
    rewards: np.ndarray  # [steps]
    populations: list[Population] = field(default_factory=list)
    operations: Operations | None = None

    @property
    def episode_return(self) -> float:
        """The sum of the rewards, in float64."""
        return float(sum(self.rewards.tolist()))


def _layers(seen: Trace) -> list[Neurons]:
    """The input and every layer of neurons."""
    inputs = seen.connections[0].inputs
    has_spikes = kind_of(inputs) == "AC" and any(layer.potentials is not None for layer in seen.neurons)
    # analog input is the same at every time step
    of_input = Neurons("input", inputs, inputs) if has_spikes else Neurons("input", inputs[:1])
    return [of_input, *seen.neurons]


def _population(layers: Sequence[Neurons], decisions: int) -> Population:
    """One layer over the decisions of the episode, every time step of the first ``decisions``."""
    name, activations, potentials = layers[0]
    return Population(
        name,
        potentials is not None,
        len(activations),
        torch.cat([each.activations[:, 0] for each in layers[:decisions]]).numpy(),
        torch.stack([each.activations[:, 0].mean(0) for each in layers]).numpy(),
    )


def play_episode(
    trained: TrainedPolicy, environment: gymnasium.Env, seed: int, decisions: int, on_step: OnStep | None = None
) -> Episode:
    """Play the first episode of ``python -m src.evaluate RUN --episodes 1 --seed SEED`` and watch it.

    Args:
        trained: the policy.
        environment: its task.
        seed: of the episode.
        decisions: how many decisions to keep every time step of.
        on_step: see :data:`OnStep`; where frames are taken.
    """
    streams = Streams(seed)
    generator, of_trace = streams.torch("evaluation encoder", FRESH), torch.Generator()
    counter: OperationCounter | None = OperationCounter()
    seen: list[list[Neurons]] = []  # by decision
    actions, rewards = [], []
    observation, _ = environment.reset(seed=streams.integer("evaluation", FRESH, 0))
    ended, total = False, 0.0
    if on_step is not None:
        on_step(0, 0.0)
    with torch.no_grad():
        while not ended:
            batch = torch.from_numpy(np.asarray(observation, np.float32)).unsqueeze(0)
            of_trace.set_state(generator.get_state())
            action = trained.act(batch, generator)[0].numpy()
            if counter is not None:
                try:
                    decision = trace(trained.policy.actor, trained.normalizer.normalize(batch), of_trace)
                    counter.add(decision)
                    seen.append(_layers(decision))
                except NotTraceable:
                    counter = None
            observation, reward, terminated, truncated, _ = environment.step(action)
            ended = bool(terminated or truncated)
            actions.append(action)
            rewards.append(float(reward))
            total += float(reward)
            if on_step is not None:
                on_step(len(rewards), total)
    episode = Episode(np.stack(actions), np.asarray(rewards, np.float64))
    if counter is not None:
        episode.populations = [_population(layers, decisions) for layers in zip(*seen)]
        episode.operations = counter.operations(trained.policy.actor, episodes=1)
    return episode
