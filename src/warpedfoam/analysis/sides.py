"""Sides and charges of a foam's bubbles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from warpedfoam.arrays import Ints, frozen
from warpedfoam.foam import Foam
from warpedfoam.network import CellNetwork


@dataclass(frozen=True, eq=False)
class SideDistribution:
    """How many bubbles have how many sides.

    Attributes
    ----------
    sides, counts : (k,) integer arrays
        The numbers of sides n that occur, ascending, and how many bubbles have each.
    total_charge : int
        Σ (6 − n); 6 χ on a closed surface.
    mean : float
        ⟨n⟩.
    mu2 : float
        μ₂ = ⟨(n − ⟨n⟩)²⟩.
    """

    sides: Ints
    counts: Ints
    total_charge: int
    mean: float
    mu2: float

    def count(self, n: int) -> int:
        """Number of bubbles with ``n`` sides."""
        return int(self.counts[self.sides == n].sum())


def side_distribution(foam: Foam | CellNetwork) -> SideDistribution:
    """Histogram of the bubbles' sides.

    Parameters
    ----------
    foam : Foam or CellNetwork

    Raises
    ------
    TypeError
        If it is neither.

    Examples
    --------
    >>> from warpedfoam import network_from_loops
    >>> tetrahedron = network_from_loops([(0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)])
    >>> found = side_distribution(tetrahedron)
    >>> found.count(3), found.total_charge, found.mu2
    (4, 12, 0.0)
    """
    network = foam.network if isinstance(foam, Foam) else foam
    if not isinstance(network, CellNetwork):
        raise TypeError(f"foam must be a Foam or a CellNetwork, got {type(foam).__name__}")
    n = network.sides
    sides, counts = np.unique(n, return_counts=True)
    mean = float(n.mean())
    return SideDistribution(
        frozen(sides), frozen(counts), int(network.charges.sum()), mean, float(((n - mean) ** 2).mean())
    )
