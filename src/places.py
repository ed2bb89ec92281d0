"""Where parameters and their gradients lie, looked up once while they stay there.

Kernels take addresses. To find and check those of some twenty parameters takes Python as long as a small product, and
it is the same at each call of a burst of updates.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from typing import Any, TypeVar

import torch
from torch import Tensor, nn

T = TypeVar("T")
#: Where the gradient of each parameter that learns belongs: contiguous, of its shape, precision and device.
GradientOf = Mapping[nn.Parameter, Tensor]


def destinations(parameters: Sequence[Tensor], gradient_of: GradientOf) -> list[Tensor]:
    """Where the gradient of each parameter belongs; a place to forget it for one that does not learn.

    Raises:
        ValueError: a place that is not like its parameter, or not contiguous: kernels write to its address.
    """
    places = [
        gradient_of[p] if p in gradient_of else torch.empty(p.shape, dtype=p.dtype, device=p.device)  # type: ignore[index]
        for p in parameters
    ]
    for g, p in zip(places, parameters):
        if g.shape != p.shape or g.dtype != p.dtype or g.device != p.device or not g.is_contiguous():
            raise ValueError("the gradient of a parameter takes a contiguous tensor of its shape, precision and device")
    return places


class Places:
    """What a module knows of where tensors lie; it remembers nothing but within :func:`fixed_places`."""

    def __init__(self) -> None:
        self._kept: dict[tuple[object, ...], tuple[object, Any]] | None = None

    def once(self, look_up: Callable[..., T], *about: object) -> T:
        """``look_up(*about)``; within :func:`fixed_places` the same function finds the same for the same objects.

        A result whose ``copied`` is true holds values, not places, and is found anew each time.
        """
        if self._kept is None:
            return look_up(*about)
        key = look_up, *map(id, about)
        if key in self._kept:
            found: T = self._kept[key][1]
            return found
        found = look_up(*about)
        if not getattr(found, "copied", False):
            self._kept[key] = about, found  # kept alive, or another object might take its id
        return found

    @contextmanager
    def fixed(self) -> Iterator[None]:
        """Within, what was found is remembered."""
        before, self._kept = self._kept, {}
        try:
            yield
        finally:
            self._kept = before

    def __getstate__(self) -> dict[str, Any]:
        return {"_kept": None}


@contextmanager
def fixed_places(*modules: nn.Module) -> Iterator[None]:
    """Within, values may change but no parameter of the modules is replaced, moved or reshaped, nor is where the
    gradients to it go.
    """
    with ExitStack() as stack:
        for module in modules:
            for part in module.modules():
                places = getattr(part, "places", None)
                if isinstance(places, Places):
                    stack.enter_context(places.fixed())
        yield
