"""A trained policy as one ONNX graph: normaliser, coding, all T steps, decoder, squashing.

    observation [B, N] (and uniform numbers [T, B, N*J] of Poisson coding) -> action [B, M]

float32, dynamic batch. The graph holds the plain PyTorch of :mod:`src.actors`, unrolled over the time steps.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from pathlib import Path

import torch
from torch import Tensor, nn

from src.actors.spike_coding import deterministic_spikes
from src.actors.spiking_actor import SpikingActor
from src.config.schema import ConfigurationError
from src.policies.trace import computes_as
from src.training.policy_file import TrainedPolicy

_OPSET = 17


class PlainPolicy(nn.Module):
    """What a policy computes, random numbers as an input.

    Args:
        trained: the policy. Its actor must draw nothing but what Poisson coding draws.
    """

    def __init__(self, trained: TrainedPolicy) -> None:
        super().__init__()
        self.actor = trained.policy.actor
        self.limit = trained.policy.action_limit
        self.normalizer = trained.normalizer
        self.draws = computes_as(self.actor, SpikingActor) and trained.config.encoder.coding == "poisson"

    def forward(self, observation: Tensor, uniform: Tensor | None = None) -> Tensor:
        """Actions ``[B, M]`` for raw observations ``[B, N]``; Poisson coding takes uniform numbers ``[T, B, N*J]``."""
        x = self.normalizer.normalize(observation)
        if computes_as(self.actor, SpikingActor):
            raw = self._spiking(self.actor, x, uniform)
        else:
            raw = self.actor(x)
        return torch.tanh(raw) * self.limit

    def _spiking(self, actor: SpikingActor, x: Tensor, uniform: Tensor | None) -> Tensor:
        strength = actor.encoder.strength(x)
        if uniform is not None:
            spikes = (uniform < strength).to(strength.dtype)
        elif actor.encoder.coding == "analog":
            spikes = strength.expand(actor.encoder.time_steps, *strength.shape)
        else:
            spikes = deterministic_spikes(strength, actor.encoder.time_steps, actor.encoder.threshold)
        raw: Tensor = actor.decoder(actor.propagate(spikes).output_spikes)
        return raw

    def example(self, batch: int) -> tuple[Tensor, ...]:
        """Inputs of the right sizes, zeros."""
        observation = torch.zeros(batch, self.normalizer.size)
        if not self.draws:
            return (observation,)
        assert isinstance(self.actor, SpikingActor)
        return observation, torch.zeros(self.actor.encoder.time_steps, batch, self.actor.encoder.size)


@torch.no_grad()
def export_onnx(trained: TrainedPolicy, path: Path) -> Sequence[str]:
    """Write the graph; returns the names of its inputs.

    Raises:
        ConfigurationError: the package onnx is missing, or the actor can't be expressed.
    """
    try:
        import onnx
    except ImportError:
        raise ConfigurationError("the package onnx is missing: pip install '.[export]'.") from None
    policy = PlainPolicy(trained).eval()
    names = ["observation", "uniform"][: 2 if policy.draws else 1]
    axes = {"observation": {0: "batch"}, "uniform": {1: "batch"}, "action": {0: "batch"}}
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # the tracer's notes on sizes that are constant here
            torch.onnx.export(
                policy,
                policy.example(1),  # initial states become constants [1, n], which go with every batch
                str(path),
                input_names=names,
                output_names=["action"],
                dynamic_axes={name: axes[name] for name in (*names, "action")},
                opset_version=_OPSET,
                dynamo=False,
            )
    except Exception as error:
        raise ConfigurationError(f"{type(policy.actor).__name__}: ONNX can't express it ({error}).") from None
    onnx.checker.check_model(str(path), full_check=True)
    return names
