"""What every actor offers to the algorithms and the training loop."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial

import torch
from torch import Tensor, nn

from src.actors.health import NOTHING_SPIKES, ActorHealth
from src.actors.population_encoder import PopulationEncoder
from src.places import GradientOf, fixed_places

#: From the gradient to the raw action ``[B, M]`` to those of the parameters, filled.
Pull = Callable[[Tensor, GradientOf], None]


class Actor(nn.Module):
    """A policy network ``observation [B, N] -> raw action [B, M]``, before squashing.

    An actor of your own needs :meth:`forward` only. What a checkpoint holds of it are its parameters: chance comes from
    ``generator`` alone (no dropout), nothing else may learn (no batch statistics), and there is no evaluation mode.
    """

    def forward(self, observation: Tensor, generator: torch.Generator | None = None) -> Tensor:
        """Raw action, ``[B, M]``.

        Args:
            observation: normalised observations, ``[B, N]``, float32.
            generator: the stream of an actor that draws (Poisson coding).
        """
        raise NotImplementedError

    def forward_with_health(
        self, observation: Tensor, generator: torch.Generator | None = None
    ) -> tuple[Tensor, ActorHealth]:
        """:meth:`forward` with the spiking health of the same pass; gradients flow through the raw action."""
        return self(observation, generator), NOTHING_SPIKES

    def minibatches(self, observation: Tensor, generator: torch.Generator | None = None) -> Tensor:
        """:meth:`forward` without gradient on G minibatches, ``[G, B, N] -> [G, B, M]``, one after the other.

        An actor may have a faster way to the same numbers; each minibatch draws its own chance, in their order.
        """
        with torch.no_grad():
            return torch.stack([self(minibatch, generator) for minibatch in observation])

    def vjp_after(
        self, before: Tensor, observation: Tensor, generator: torch.Generator | None = None, with_health: bool = False
    ) -> tuple[Tensor, Tensor, ActorHealth | None, Pull]:
        """The raw action of ``before``, without gradient, and then :meth:`vjp` of the observation; both ``[B, N]``.

        An actor may have a faster way to the same numbers.
        """
        with torch.no_grad():
            raw_before = self(before, generator)
        return raw_before, *self.vjp(observation, generator, with_health)

    def vjp(
        self, observation: Tensor, generator: torch.Generator | None = None, with_health: bool = False
    ) -> tuple[Tensor, ActorHealth | None, Pull]:
        """The raw action and its vector-Jacobian product, as of ``torch.func.vjp``: what an algorithm learns by.

        Here by autograd through :meth:`forward`. An actor may have a faster way to the same numbers, past hooks of its
        modules.

        Args:
            observation: as for :meth:`forward`.
            generator: as for :meth:`forward`.
            with_health: whether to measure the spiking health of the pass.

        Returns:
            The raw action ``[B, M]`` without graph; the health, or None; and the function that takes the gradient to
            the raw action and fills those of the parameters, to be called once, before a parameter changes.
        """
        health = None
        with torch.enable_grad():
            if with_health:
                raw, health = self.forward_with_health(observation, generator)
            else:
                raw = self(observation, generator)
        return raw.detach(), health, partial(self._pull, raw)

    def _pull(self, raw: Tensor, to_raw: Tensor, gradient_of: GradientOf) -> None:
        parameters = [parameter for parameter in self.parameters() if parameter in gradient_of]
        gradients = torch.autograd.grad(raw, parameters, to_raw, allow_unused=True, materialize_grads=True)
        for parameter, gradient in zip(parameters, gradients):
            gradient_of[parameter].copy_(gradient)

    def layer_parameters(self) -> list[list[nn.Parameter]]:
        """The parameters of each spiking layer, for gradient norms."""
        return []

    def project(self) -> None:
        """Bring the parameters back into their range; called after each optimizer step. Here: the encoder's sigma."""
        for module in self.modules():
            if isinstance(module, PopulationEncoder):
                module.project()

    @contextmanager
    def fixed_weights(self) -> Iterator[None]:
        """Within, no parameter changes (collecting, evaluating): what is derived from them may be computed once."""
        with fixed_places(self):
            yield

    def connection_count(self) -> int:
        """Learnable numbers; of a dendritic layer each unmasked synapse once."""
        return sum(parameter.numel() for parameter in self.parameters() if parameter.requires_grad)
