"""The fused spiking layer behind one call: kernel where there is one, the reference elsewhere."""

from __future__ import annotations

from collections.abc import Sequence

from torch import Tensor

from src.actors.lif import LIFConstants, lif_reference


def lif(
    currents: Tensor,
    bias: Tensor | None,
    lateral: Tensor | None,
    offsets: Sequence[int],
    branches: int,
    constants: LIFConstants,
    membrane: bool = False,
) -> tuple[Tensor, Tensor | None]:
    """Spikes ``[T, B, n]`` and, asked for, membrane potentials; arguments as :func:`lif_reference`."""
    spikes, membrane_potential, _ = lif_reference(currents, bias, lateral, offsets, branches, constants)
    return spikes, membrane_potential.detach() if membrane else None
