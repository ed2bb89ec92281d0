"""What counted operations are worth: ratios to the artificial network, and energy at named constants (docs/report.md).

A run's ``operations.json`` counts, for every actor alike, the multiply-accumulates (MACs) and accumulates (ACs) of its
trained policy with sparsity taken into account. Which actor is cheaper depends on what a MAC costs beside an AC, so the
ratio at which the order turns stands beside the energies. Memory traffic is outside all of them.
"""

from __future__ import annotations

from typing import NamedTuple

#: Operations that one membrane update is priced at: NeuroBench's for a current-based neuron with reset to zero.
UPDATE_OPERATIONS = 8


class Prices(NamedTuple):
    """Picojoule for one MAC and one AC."""

    name: str
    source: str
    mac: float
    ac: float

    def nanojoule(self, macs: float, acs: float) -> float:
        """Energy of so many operations."""
        return (self.mac * macs + self.ac * acs) / 1000


PRICES = (
    Prices("45nm", "45 nm CMOS, 32-bit floating point: 4.6 pJ a MAC, 0.9 pJ an AC", 4.6, 0.9),
    Prices("77fJ", "the Proxy Target paper's constants: 3.97 pJ a MAC, 77 fJ an AC", 3.97, 0.077),
)


def turning_ratio(macs: float, acs: float, other_macs: float, other_acs: float) -> float:
    """The cost of a MAC in ACs at which ``macs + acs`` of one actor cost what those of the other do.

    The actor with fewer MACs is the cheaper one above it. NaN where one actor has no more of either, so that no ratio
    turns the order.
    """
    if (macs - other_macs) * (acs - other_acs) >= 0:
        return float("nan")
    return (acs - other_acs) / (other_macs - macs)
